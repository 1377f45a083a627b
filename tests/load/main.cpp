// catgs-load: many headless clients of catgs-server, and what they got.
#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <spdlog/spdlog.h>

#include "render_core/base/build_info.h"
#include "render_core/base/command_line.h"
#include "render_core/base/error.h"
#include "render_core/base/printable.h"
#include "render_core/tools/json_report.h"
#include "tests/load/chart_document.h"
#include "tests/load/metrics.h"
#include "tests/load/record.h"
#include "tests/load/report.h"
#include "tests/load/run_scenario.h"

namespace catgs::load {
namespace {

constexpr int exit_requirement_failed = 1;
constexpr int exit_bad_input = 2;
constexpr int exit_internal = 3;

struct ProgramOptions {
  Scenario scenario;  // what no scenario file says
  GroupOptions group;
  std::string file, server, server_log, url, token;
  double duration_s = -1.0;  // not given
  int check_every = 0;       // not given
  bool insecure = false;
  std::string json, html;
  std::vector<std::string> without;
  std::vector<std::string> requirements;
};

// Options that a scenario file replaces.
constexpr const char* client_group = "Clients";

void add_options(CLI::App& app, ProgramOptions& options) {
  auto* file = app.add_option("--scenario", options.file, "TOML file with a whole run");
  app.add_option("--without", options.without, "Groups of the scenario to leave out")->needs(file);
  app.add_option("--url", options.url, "ws://HOST:PORT or wss://HOST:PORT");
  app.add_option("--server", options.server,
                 "Without --url a scenario starts this command itself (default: the catgs-server "
                 "beside this program)");
  app.add_option("--server-log", options.server_log, "Its log (default: catgs-load-server.log)")
      ->default_val("catgs-load-server.log");
  add_duration(app, "--duration", options.duration_s, "Of the whole run (default: 30s)");
  app.option_defaults()->group(client_group);
  add_client_options(app, options.group);
  app.option_defaults()->group("Options");
  for (CLI::Option* option : app.get_options()) {
    const bool of_clients = option->get_group() == client_group;
    if (of_clients) option->excludes(file);
  }
  app.add_option("--token", options.token, "Access token (better: the variable)")
      ->envname("CATGS_TOKEN");
  app.add_flag("--insecure", options.insecure, "Accept any TLS certificate");
  app.add_option("--check-scene", options.scenario.check.scenes,
                 "Compare pictures with this scene, rendered here: a file or synth:…; repeatable");
  app.add_option("--check-every", options.check_every,
                 "With --glass: judge one of so many refreshes (default: 7), and each new frame "
                 "at rest")
      ->check(CLI::Range(1, 10'000));
  app.add_option("--worst", options.scenario.check.worst_folder,
                 "With --glass: folder for PNGs of the worst refreshes, shown and exact");
  app.add_option("--json", options.json, "Write the report here; - prints it instead");
  app.add_option("--html", options.html,
                 "Write a page with plots here (needs the built web client)");
  app.add_option("--require", options.requirements,
                 "METRIC OP NUMBER, repeatable: exit with 1 where it does not hold; METRIC@FROM-TO "
                 "is about a part of the run")
      ->take_all();
  app.footer(
      "Exit codes: 0 done, 1 a requirement failed, 2 bad usage or input, 3 internal.\n"
      "Example: catgs-load --url ws://127.0.0.1:8080 --sessions 8 --script head "
      "--decode --require 'errors==0' --require 'pose_to_frame_p95_ms<100'");
}

/// A group of clients, and what the scenario requires of them.
void leave_out(const std::string& name, Scenario& scenario) {
  const auto removed = std::erase_if(scenario.load.groups,
                                     [&](const GroupOptions& group) { return group.name == name; });
  if (removed == 0) throw InputError("--without", name, "there are no such clients");
  if (scenario.load.groups.empty()) throw InputError("--without", name, "leaves no clients");
  std::erase_if(scenario.requirements,
                [&](const std::string& text) { return text.starts_with(name + "."); });
}

/// The scenario of the file, or the one that the flags describe.
Scenario scenario_of(const ProgramOptions& options) {
  Scenario scenario = options.scenario;
  if (options.file.empty()) {
    if (options.url.empty()) throw InputError("--url, --scenario", "", "one of them is needed");
    scenario.load.groups = {options.group};
  } else {
    scenario = read_scenario(options.file, options.scenario.check.scenes);
    scenario.check.worst_folder = options.scenario.check.worst_folder;
    for (const std::string& name : options.without) leave_out(name, scenario);
  }
  if (options.check_every > 0) scenario.check.every = options.check_every;
  if (options.duration_s >= 0.0) scenario.load.duration_s = options.duration_s;
  scenario.load.url = options.url;
  scenario.load.token = options.token;
  scenario.load.insecure = options.insecure;
  scenario.requirements.insert(scenario.requirements.end(), options.requirements.begin(),
                               options.requirements.end());
  return scenario;
}

/// The words of --server, or the catgs-server beside this program.
std::vector<std::string> server_command(const std::string& text) {
  std::istringstream stream(text);
  std::vector<std::string> words{std::istream_iterator<std::string>(stream), {}};
  if (words.empty()) {
    const auto self = std::filesystem::read_symlink("/proc/self/exe");
    words.push_back((self.parent_path() / "catgs-server").string());
  }
  return words;
}

nlohmann::ordered_json settings_json(const Scenario& scenario) {
  nlohmann::ordered_json json = {{"title", scenario.title},
                                 {"url", scenario.load.url},
                                 {"server_args", scenario.server_args},
                                 {"duration_s", scenario.load.duration_s}};
  for (const GroupOptions& group : scenario.load.groups) {
    json["clients"].push_back({{"name", group.name},
                               {"sessions", group.sessions},
                               {"traces", group.traces},
                               {"script", group.script.script},
                               {"seed", group.script.seed},
                               {"ramp_s", group.ramp_s},
                               {"sizes", group.sizes},
                               {"fps", group.wishes.fps},
                               {"link", group.link.text},
                               {"decode", group.manners.decode}});
  }
  return json;
}

struct RecordFlags {
  RecordOptions options;
  std::string out;
};

void add_record_command(CLI::App& app, RecordFlags& flags) {
  CLI::App* record = app.add_subcommand(
      "record",
      "Stands between a browser and the server and saves the browser's poses as a TUM file. Open "
      "http://127.0.0.1:8081/ instead of the server's page, move, and stop with Ctrl-C");
  record->add_option("--url", flags.options.url, "The server: ws://HOST:PORT or wss://HOST:PORT")
      ->required();
  record->add_flag("--insecure", flags.options.insecure, "Accept any TLS certificate");
  record->add_option("--listen", flags.options.listen, "Port on this machine for the browser")
      ->capture_default_str();
  add_duration(*record, "--duration", flags.options.duration_s,
               "Stop after this time (default: Ctrl-C)");
  record->add_option("--out", flags.out, "TUM file to write")->required();
}

int run_record(RecordFlags& flags) {
  flags.options.on_listening = [](std::uint16_t port) {
    fmt::print(stderr, "open http://127.0.0.1:{}/ and move; Ctrl-C ends the recording\n", port);
  };
  const Trajectory poses = record_poses(flags.options);
  if (poses.empty()) {
    throw InputError("--out", flags.out, "no browser has sent a pose",
                     "open the page through the recording port");
  }
  write_tum(flags.out, poses);
  fmt::print("{}: {} poses over {:.1f} s\n", flags.out, poses.size(),
             1e-6 * static_cast<double>(poses.back().time_us));
  return 0;
}

void write_file(const std::string& path, const std::string& text) {
  std::ofstream file(path, std::ios::binary);
  file << text;
  file.close();
  if (!file) throw InputError(path, "", "cannot be written");
}

int run_checked(const ProgramOptions& options) {
  const Scenario scenario = scenario_of(options);
  const std::string page = options.html.empty() ? "" : read_charts_page();
  const Outcome outcome =
      run_scenario(scenario, server_command(options.server), options.server_log);
  if (options.json != "-") fmt::print("{}", to_table(outcome.report, scenario.bounds));
  if (!options.json.empty()) {
    nlohmann::ordered_json json = {{"version", build_version},
                                   {"commit", build_commit},
                                   {"settings", settings_json(scenario)}};
    json.update(to_json(outcome.report, outcome.metrics, scenario.bounds));
    write_json(options.json, json);
  }
  if (!options.html.empty())
    write_file(options.html, with_document(page, chart_document(scenario, outcome)));
  for (const Requirement& requirement : outcome.requirements) {
    const bool held = requirement.holds(outcome.metrics);
    fmt::print(stderr, "catgs-load: {}: {}\n", held ? "holds" : "requirement failed",
               requirement.explain(outcome.metrics));
  }
  if (outcome.requirements.empty() && value_of(outcome.metrics, "sessions_connected") == 0.0) {
    fmt::print(stderr, "catgs-load: requirement failed: no session ever connected, see above\n");
    return exit_requirement_failed;
  }
  return outcome.all_hold() ? 0 : exit_requirement_failed;
}

int run(int argc, char** argv) {
  CLI::App app("Replays camera motion against catgs-server and reports what clients would see.",
               "catgs-load");
  app.set_version_flag("--version", build_version);
  app.failure_message([](const CLI::App*, const CLI::Error& error) {
    return fmt::format("catgs-load: {} (see --help)\n", error.what());
  });
  ProgramOptions options;
  add_options(app, options);
  RecordFlags record;
  add_record_command(app, record);
  spdlog::set_level(spdlog::level::warn);  // loading a scene tells a server's operator, not us
  try {
    parse_command_line(app, argc, argv);
    return app.got_subcommand("record") ? run_record(record) : run_checked(options);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : exit_bad_input;
  } catch (const InputError& error) {
    fmt::print(stderr, "catgs-load: {}\n", printable(error.what()));
    return exit_bad_input;
  } catch (const std::exception& error) {
    fmt::print(stderr, "catgs-load: internal error: {}\n", printable(error.what()));
    return exit_internal;
  }
}

}  // namespace
}  // namespace catgs::load

int main(int argc, char** argv) { return catgs::load::run(argc, argv); }

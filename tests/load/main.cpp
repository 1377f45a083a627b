// catgs-load: many headless clients of catgs-server, and what they got.
#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "render_core/build_info.h"
#include "render_core/error.h"
#include "render_core/tools/json_report.h"
#include "tests/load/load.h"
#include "tests/load/report.h"
#include "tests/load/requirement.h"
#include "tests/load/units.h"

namespace catgs::load {
namespace {

constexpr int exit_requirement_failed = 1;
constexpr int exit_bad_input = 2;
constexpr int exit_internal = 3;

struct ProgramOptions {
  LoadOptions load;
  GroupOptions group;
  std::string duration = "30s";
  std::string ramp = "0s";
  std::string link;
  std::string decode_time = "0s";
  std::string reconnect_every = "0s";
  std::string json;
  std::vector<std::string> requirements;
};

void add_client_options(CLI::App& app, ProgramOptions& options) {
  GroupOptions& group = options.group;
  auto* trace = app.add_option("--trace", group.traces,
                               "TUM files, replayed at their own times, forth and back; sessions "
                               "take turns and begin at different places");
  app.add_flag("--anchor", group.anchor, "Move traces to the scene's start pose")->needs(trace);
  app.add_option("--script", group.script.script, "orbit, walk, head, drone, still or tour:FILE")
      ->excludes(trace);
  app.add_option("--seed", group.script.seed, "Of the script; each session adds its number")
      ->capture_default_str();
  app.add_option("--scene", group.scene, "Scene id (default: the server's first)");
  app.add_option("--size", group.sizes, "Wanted frame sizes, pixels; sessions take turns")
      ->capture_default_str();
  app.add_option("--fps", group.fps, "Wanted and nominal frame rate")
      ->check(CLI::Range(1, 240))
      ->capture_default_str();
  app.add_option("--max-bitrate-kbps", group.max_bitrate_kbps, "0: the server's default")
      ->check(CLI::Range(0, 200'000))
      ->capture_default_str();
  app.add_option("--fov-deg", group.fov_y_deg, "Vertical field of view")->capture_default_str();
  app.add_option("--link", options.link,
                 "Each session's line: rate=50mbit@0s,5mbit@10s,up=5mbit,delay=20ms,jitter=5ms,"
                 "loss=1%,burst=4,queue=200ms; each part may be left out");
  app.add_flag("--decode", group.decode, "Decode every frame and check its size");
  app.add_option("--decode-time", options.decode_time, "Play a decoder that takes this long");
  app.add_flag("!--no-acks", group.acknowledge,
               "Never acknowledge a frame: the server must stop sending");
  app.add_option("--flood-hz", group.flood_hz, "Send so many messages a second too many")
      ->check(CLI::Range(0, 100'000));
  app.add_option("--reconnect-every", options.reconnect_every,
                 "Drop all sockets at once, again and again");
}

void add_options(CLI::App& app, ProgramOptions& options) {
  app.add_option("--url", options.load.url, "ws://HOST:PORT or wss://HOST:PORT")->required();
  app.add_option("--sessions", options.group.sessions, "Clients at the same time")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  app.add_option("--duration", options.duration, "Of the whole run")->capture_default_str();
  app.add_option("--ramp", options.ramp, "Spread the starts over this time")->capture_default_str();
  add_client_options(app, options);
  app.add_option("--token", options.load.token, "Access token (better: the variable)")
      ->envname("CATGS_TOKEN");
  app.add_flag("--insecure", options.load.insecure, "Accept any TLS certificate");
  app.add_option("--json", options.json, "Write the report here; - prints it instead");
  app.add_option("--require", options.requirements,
                 "METRIC OP NUMBER, repeatable: exit with 1 where it does not hold; METRIC@FROM-TO "
                 "is about a part of the run")
      ->take_all();
  app.footer(
      "Exit codes: 0 done, 1 a requirement failed, 2 bad usage or input, 3 internal.\n"
      "Example: catgs-load --url ws://127.0.0.1:8080 --sessions 8 --script head "
      "--decode --require 'errors==0' --require 'pose_to_frame_p95_ms<100'");
}

void write_report(const ProgramOptions& options, const RunReport& report, const Metrics& metrics) {
  const HoldBounds bounds;
  if (options.json != "-") fmt::print("{}", to_table(report, bounds));
  if (options.json.empty()) return;
  const GroupOptions& group = options.group;
  nlohmann::ordered_json json = {{"version", build_version}, {"commit", build_commit}};
  json["settings"] = {{"url", options.load.url},   {"sessions", group.sessions},
                      {"traces", group.traces},    {"script", group.script.script},
                      {"seed", group.script.seed}, {"duration_s", options.load.duration_s},
                      {"ramp_s", group.ramp_s},    {"sizes", group.sizes},
                      {"fps", group.fps},          {"link", options.link},
                      {"decode", group.decode}};
  json.update(to_json(report, metrics, bounds));
  write_json(options.json, json);
}

/// Everything that requirements may name, of a run that has not been yet.
void check_requirements(const std::vector<Requirement>& requirements, const LoadOptions& load) {
  RunReport empty;
  for (const GroupOptions& group : load.groups) {
    empty.groups.push_back(
        {group.name, static_cast<double>(group.fps), std::make_unique<TimeSeries>(0), {}});
  }
  const Metrics metrics = collect_metrics(empty, {});
  for (const Requirement& requirement : requirements) {
    if (is_window_metric(requirement.metric()))
      (void)window_metric(empty, requirement.metric());
    else
      requirement.check_name(metrics);
  }
}

int run_checked(ProgramOptions& options) {
  options.load.duration_s = parse_duration_s("--duration", options.duration);
  options.group.ramp_s = parse_duration_s("--ramp", options.ramp);
  options.group.link = parse_link("--link", options.link);
  options.group.decode_time_s = parse_duration_s("--decode-time", options.decode_time);
  options.group.reconnect_every_s = parse_duration_s("--reconnect-every", options.reconnect_every);
  options.load.groups = {options.group};
  std::vector<Requirement> requirements;
  for (const std::string& text : options.requirements) requirements.emplace_back(text);
  check_requirements(requirements, options.load);
  const RunReport report = run_load(options.load);
  Metrics metrics = collect_metrics(report, {});
  for (const Requirement& requirement : requirements) {
    const std::string& name = requirement.metric();
    if (is_window_metric(name)) metrics.emplace_back(name, window_metric(report, name));
  }
  write_report(options, report, metrics);
  int exit_code = 0;
  for (const Requirement& requirement : requirements) {
    if (requirement.holds(metrics)) continue;
    fmt::print(stderr, "catgs-load: requirement failed: {}\n", requirement.explain(metrics));
    exit_code = exit_requirement_failed;
  }
  return exit_code;
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
  try {
    app.parse(argc, argv);
    return run_checked(options);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : exit_bad_input;
  } catch (const InputError& error) {
    fmt::print(stderr, "catgs-load: {}\n", error.what());
    return exit_bad_input;
  } catch (const std::exception& error) {
    fmt::print(stderr, "catgs-load: internal error: {}\n", error.what());
    return exit_internal;
  }
}

}  // namespace
}  // namespace catgs::load

int main(int argc, char** argv) { return catgs::load::run(argc, argv); }

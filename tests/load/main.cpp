// catgs-load: many headless clients of catgs-server, and what they got.
#include <charconv>
#include <utility>

#include <CLI/CLI.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "render_core/build_info.h"
#include "render_core/error.h"
#include "render_core/tools/json_report.h"
#include "tests/load/load.h"

namespace catgs::load {
namespace {

constexpr int exit_requirement_failed = 1;
constexpr int exit_bad_input = 2;
constexpr int exit_internal = 3;

struct ProgramOptions {
  LoadOptions load;
  std::string duration = "30s";
  std::string ramp = "0s";
  std::string json;
  std::vector<std::string> requirements;
};

/// "30", "30s", "500ms", "2m" in seconds.
double parse_duration(std::string_view flag, const std::string& text) {
  constexpr std::pair<std::string_view, double> units[] = {
      {"ms", 1e-3}, {"s", 1.0}, {"m", 60.0}, {"h", 3600.0}, {"", 1.0}};
  double value = 0.0;
  const char* end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, value);
  for (const auto& [unit, seconds] : units) {
    if (error == std::errc() && std::string_view(stop, end) == unit && value >= 0.0) {
      return value * seconds;
    }
  }
  throw InputError(flag, "", fmt::format("\"{}\" is not a duration", text),
                   "like 30s, 500ms or 2m");
}

void add_options(CLI::App& app, ProgramOptions& options) {
  LoadOptions& load = options.load;
  app.add_option("--url", load.url, "ws://HOST:PORT or wss://HOST:PORT")->required();
  app.add_option("--sessions", load.sessions, "Clients at the same time")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  auto* trace = app.add_option("--trace", load.traces,
                               "TUM files, replayed at their own times, forth and back; sessions "
                               "take turns and begin at different places");
  app.add_flag("--anchor", load.anchor, "Move traces to the scene's start pose")->needs(trace);
  app.add_option("--script", load.script.script, "orbit, walk, head, drone, still or tour:FILE")
      ->excludes(trace);
  app.add_option("--seed", load.script.seed, "Of the script; each session adds its number")
      ->capture_default_str();
  app.add_option("--duration", options.duration, "Of the whole run")->capture_default_str();
  app.add_option("--ramp", options.ramp, "Spread the starts over this time")->capture_default_str();
  app.add_option("--scene", load.scene, "Scene id (default: the server's first)");
  app.add_option("--size", load.size, "Wanted frame size, pixels")->capture_default_str();
  app.add_option("--fps", load.fps, "Wanted and nominal frame rate")
      ->check(CLI::Range(1, 240))
      ->capture_default_str();
  app.add_option("--max-bitrate-kbps", load.max_bitrate_kbps, "0: the server's default")
      ->check(CLI::Range(0, 200'000))
      ->capture_default_str();
  app.add_option("--fov-deg", load.fov_y_deg, "Vertical field of view")->capture_default_str();
  app.add_flag("--decode", load.decode, "Decode every frame and check its size");
  app.add_flag("!--no-acks", load.acknowledge,
               "Never acknowledge a frame: the server must stop sending");
  app.add_option("--token", load.token, "Access token (better: the variable)")
      ->envname("CATGS_TOKEN");
  app.add_flag("--insecure", load.insecure, "Accept any TLS certificate");
  app.add_option("--json", options.json, "Write the report here; - prints it instead");
  app.add_option("--require", options.requirements,
                 "METRIC OP NUMBER, repeatable: exit with 1 where it does not hold")
      ->take_all();
  app.footer(
      "Exit codes: 0 done, 1 a requirement failed, 2 bad usage or input, 3 internal.\n"
      "Example: catgs-load --url ws://127.0.0.1:8080 --sessions 8 --script head "
      "--decode --require 'errors==0' --require 'pose_to_frame_p95_ms<100'");
}

void write_report(const ProgramOptions& options, const SessionReports& reports,
                  const Metrics& metrics) {
  if (options.json != "-") fmt::print("{}", to_table(reports, metrics));
  if (options.json.empty()) return;
  nlohmann::ordered_json json = {{"version", build_version}, {"commit", build_commit}};
  json["settings"] = {{"url", options.load.url},          {"sessions", options.load.sessions},
                      {"traces", options.load.traces},    {"script", options.load.script.script},
                      {"seed", options.load.script.seed}, {"duration_s", options.load.duration_s},
                      {"ramp_s", options.load.ramp_s},    {"size", options.load.size},
                      {"fps", options.load.fps},          {"decode", options.load.decode}};
  json.update(to_json(reports, metrics));
  write_json(options.json, json);
}

int run_checked(ProgramOptions& options) {
  options.load.duration_s = parse_duration("--duration", options.duration);
  options.load.ramp_s = parse_duration("--ramp", options.ramp);
  std::vector<Requirement> requirements;
  for (const std::string& text : options.requirements) requirements.emplace_back(text);
  for (const Requirement& requirement : requirements) {
    requirement.check_name(collect_metrics({}, options.load.fps));
  }
  const SessionReports reports = run_load(options.load);
  const Metrics metrics = collect_metrics(reports, options.load.fps);
  write_report(options, reports, metrics);
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

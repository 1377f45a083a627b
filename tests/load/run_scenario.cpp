#include "tests/load/run_scenario.h"

#include <algorithm>
#include <csignal>
#include <memory>
#include <utility>

#include "render_core/base/error.h"
#include "tests/load/load.h"
#include "tests/load/picture_check.h"

namespace catgs::load {
namespace {

void append(Metrics& metrics, Metrics more) {
  for (auto& metric : more) metrics.push_back(std::move(metric));
}

/// Everything that requirements may name, of a run that has not been yet.
void check_names(const std::vector<Requirement>& requirements, const Scenario& scenario,
                 const ServerProcess* server) {
  RunReport empty;
  for (const GroupOptions& group : scenario.load.groups) {
    empty.groups.push_back(
        {group.name, static_cast<double>(group.wishes.fps), std::make_unique<TimeSeries>(0), {}});
  }
  Metrics metrics = collect_metrics(empty, scenario.bounds);
  if (server != nullptr) append(metrics, server->metrics());
  for (const Requirement& requirement : requirements) {
    const std::string& name = requirement.metric();
    if (is_window_metric(name)) {
      (void)window_metric(empty, name);
      continue;
    }
    requirement.check_name(metrics);
    if (name.ends_with("held") && scenario.check.scenes.empty()) {
      throw InputError("--require", name, "needs pictures to be compared",
                       "--check-scene names the server's scene, --decode decodes");
    }
  }
}

bool judges_displays(const Scenario& scenario) {
  return std::ranges::any_of(scenario.load.groups,
                             [](const GroupOptions& group) { return group.display.judged; });
}

/// Signals of the scenario as actions of the run.
std::vector<TimedAction> actions_of(const Scenario& scenario, const ServerProcess* server) {
  if (!scenario.signals.empty() && server == nullptr) {
    throw InputError("--url", "", "the scenario sends signals to a server of its own",
                     "leave --url out");
  }
  std::vector<TimedAction> actions;
  for (const ServerSignal& signal : scenario.signals) {
    actions.push_back({.at_s = signal.at_s,
                       .action = [server, number = signal.number] { server->signal(number); },
                       .recovers = signal.number == SIGCONT});
  }
  return actions;
}

}  // namespace

bool Outcome::all_hold() const {
  return std::ranges::all_of(requirements, [&](const auto& r) { return r.holds(metrics); });
}

Outcome run_scenario(Scenario scenario, const std::vector<std::string>& server_command,
                     const std::filesystem::path& server_log) {
  Outcome outcome;
  if (judges_displays(scenario) && scenario.check.scenes.empty()) {
    throw InputError("--glass", "", "needs exact pictures to compare with",
                     "--check-scene names the server's scene");
  }
  for (const std::string& text : scenario.requirements) outcome.requirements.emplace_back(text);
  std::unique_ptr<ServerProcess> server;
  if (scenario.load.url.empty()) {
    std::vector<std::string> command = server_command;
    command.insert(command.end(), scenario.server_args.begin(), scenario.server_args.end());
    server = std::make_unique<ServerProcess>(std::move(command), server_log);
    scenario.load.url = server->url();
    server->begin_measuring();
  }
  check_names(outcome.requirements, scenario, server.get());
  scenario.load.actions = actions_of(scenario, server.get());
  scenario.load.pictures = scenario.check.scenes.empty() ? 0 : scenario.pictures;
  outcome.report = run_load(scenario.load);
  if (server) {
    server->end_measuring();
    server->stop();
    outcome.usage = server->usage();
  }
  if (!scenario.check.scenes.empty()) check_pictures(scenario.check.scenes, outcome.report);
  if (judges_displays(scenario)) check_displays(scenario.check, outcome.report);
  outcome.metrics = collect_metrics(outcome.report, scenario.bounds);
  if (server) append(outcome.metrics, server->metrics());
  for (const Requirement& requirement : outcome.requirements) {
    const std::string& name = requirement.metric();
    if (is_window_metric(name))
      outcome.metrics.emplace_back(name, window_metric(outcome.report, name));
  }
  return outcome;
}

}  // namespace catgs::load

#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "tests/load/requirement.h"
#include "tests/load/scenario.h"
#include "tests/load/server_process.h"

namespace catgs::load {

/// The results of a run.
struct Outcome {
  RunReport report;
  Metrics metrics;
  std::vector<UsageSample> usage;  // of a server of its own
  std::vector<Requirement> requirements;

  [[nodiscard]] bool all_hold() const;
};

/// Runs the clients, against a server of its own where the scenario has no url: `server_command`
/// and the scenario's arguments, its log in `server_log`. Requirements are checked for slips of the
/// pen before the clients start. Throws InputError.
Outcome run_scenario(Scenario scenario, const std::vector<std::string>& server_command,
                     const std::filesystem::path& server_log);

}  // namespace catgs::load

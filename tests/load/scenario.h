#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "tests/load/display_check.h"
#include "tests/load/metrics.h"
#include "tests/load/options.h"

namespace catgs::load {

/// A signal to the server in the middle of a run: STOP, CONT, TERM, HUP or KILL.
struct ServerSignal {
  double at_s = 0.0;
  int number = 0;
};

/// A whole run: which server, which clients, what must come out. From a file, or from flags.
struct Scenario {
  std::string title;
  LoadOptions load;
  std::vector<std::string> server_args;  // of a server that the run starts for itself
  std::vector<ServerSignal> signals;
  DisplayCheck check;  // without scenes nothing is compared
  int pictures = 32;   // decoded ones to compare, in all
  HoldBounds bounds;
  std::vector<std::string> requirements;
};

/// Reads a TOML file; README.md lists its keys. Paths in it are relative to it. `check_scenes`
/// replace its own. Throws InputError with the line of a mistake.
Scenario read_scenario(const std::filesystem::path& path,
                       const std::vector<std::string>& check_scenes = {});

}  // namespace catgs::load

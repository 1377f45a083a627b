#pragma once

#include <filesystem>
#include <string>
#include <vector>

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
  std::string check_scene;  // file or synth:…, to compare decoded pictures with; empty: none are
  int pictures = 32;        // of them, in all
  HoldBounds bounds;
  std::vector<std::string> requirements;
};

/// Reads a TOML file; README.md lists its keys. Paths in it are relative to it. Throws InputError
/// with the line of a mistake.
Scenario read_scenario(const std::filesystem::path& path);

}  // namespace catgs::load

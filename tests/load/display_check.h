#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "tests/load/run_report.h"

namespace catgs::load {

struct DisplayCheck {
  std::vector<std::string> scenes;  // as for ExactPictures
  int every = 7;                    // refreshes; at rest each new frame is judged besides
  /// For PNGs of the worst refreshes of each group, GROUP-N-shown.png and GROUP-N-exact.png; empty:
  /// none are written.
  std::filesystem::path worst_folder{};
};

/// Makes what sessions showed again, frame by frame, and judges it by the exact pictures of the
/// visitors' cameras: SessionReport::judged. Throws as ExactPictures does, and InputError where a
/// PNG cannot be written.
void check_displays(const DisplayCheck& check, RunReport& report);

}  // namespace catgs::load

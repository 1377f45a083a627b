#pragma once

#include <optional>
#include <string>
#include <vector>

#include "render_core/motion/script.h"
#include "tests/load/report.h"

namespace catgs::load {

struct LoadOptions {
  std::string url;
  std::string token;
  std::string scene;
  int sessions = 1;
  std::vector<std::string> traces;
  bool anchor = false;
  ScriptOptions script;
  double duration_s = 30.0;
  double ramp_s = 0.0;
  std::string size = "1280x720";
  int fps = 60;
  int max_bitrate_kbps = 0;
  float fov_y_deg = 60.0f;
  bool decode = false;
  bool acknowledge = true;
  bool insecure = false;
};

/// Runs the sessions to their end and returns their reports. Throws InputError on bad options.
SessionReports run_load(const LoadOptions& options);

}  // namespace catgs::load

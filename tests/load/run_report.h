#pragma once

#include <memory>
#include <string>
#include <vector>

#include "render_core/camera.h"
#include "server/encode/decoder.h"
#include "tests/load/session_stats.h"
#include "tests/load/time_series.h"

namespace catgs::load {

/// A decoded frame, and what it was a picture of.
struct PictureSample {
  Pose render_pose;
  float fov_y_rad = 0.0f;
  float near_z = 0.0f;
  std::string scene_id;
  DecodedPicture picture;
  double psnr_db = 0.0;  // once check_pictures() has judged it
};

struct SessionReport {
  SessionReport(double nominal_fps, TimeSeries* series) : stats(nominal_fps, series) {}
  SessionStats stats;
  std::string renderer, encoder, server_version;  // as the last Welcome said
  std::vector<PictureSample> pictures;
};

using SessionReports = std::vector<std::unique_ptr<SessionReport>>;

struct GroupReport {
  std::string name;
  double nominal_fps = 0.0;
  std::unique_ptr<TimeSeries> series;
  SessionReports sessions;
};

struct RunReport {
  std::vector<GroupReport> groups;
};

}  // namespace catgs::load

#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "render_core/math/camera.h"
#include "render_core/math/stereo.h"
#include "server/encode/decoder.h"
#include "tests/load/display.h"
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
  double psnr_db = 0.0;       // once check_pictures() has judged it
  int rest = 0;               // counted from 1: the camera rests; 0: taken as it went
  std::int64_t after_us = 0;  // at rest: decoded so long after the last pose that moved
  std::optional<Stereo> stereo{};
};

/// Pictures of so many rests are kept: they stay in memory until the end.
inline constexpr int max_rests = 6;

/// The camera of a session rests.
struct RestingCamera {
  int number = 0;  // counted from 1
  std::uint64_t pose_id = 0;
  std::int64_t since_us = 0;  // when its last pose was sent
};

struct SessionReport {
  SessionReport(double nominal_fps, TimeSeries* series) : stats(nominal_fps, series) {}
  SessionStats stats;
  std::string renderer, encoder, server_version;  // as the last Welcome said
  std::vector<PictureSample> pictures;
  std::optional<RestingCamera> rest;
  int rests = 0;  // that lasted
  glm::ivec2 still_size_px{0};
  std::optional<DisplayLog> display;  // with --glass
  std::vector<JudgedRefresh> judged;  // once check_displays() has looked at it
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

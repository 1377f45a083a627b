#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <glm/vec2.hpp>

#include "server/encode/encoder.h"
#include "tests/load/depth_warp.h"
#include "tests/load/warp.h"

namespace catgs::load {

/// Everything that a client showed, so that its pictures can be made again after the run.
struct DisplayLog {
  struct Frame {
    Eye eye;  // that it was drawn for
    glm::ivec2 size_px{0};
    Depths depths{};
    std::int64_t pose_us = 0;  // when the pose behind it was sampled
    Codec codec = Codec::h264;
    bool first = false;  // of its decoder
    std::vector<std::byte> bitstream;
  };
  struct Refresh {
    std::int64_t time_us = 0;
    std::size_t frame = 0;      // the newest decoded
    Pose camera;                // the visitor's
    double distance = 0.0;      // to the plane that a warp by one plane is exact for; 0: no warp
    double overscan = 1.0;      // height of pictures over that of the view
    int rest = 0;               // counted from 1; 0: the camera moves
    std::int64_t after_us = 0;  // at rest: since the last pose that moved
  };
  glm::ivec2 view_px{0};
  float fov_y_rad = 0.0f;  // of the view
  float near_z = 0.0f;
  std::string scene_id;
  std::vector<Frame> frames;
  std::vector<Refresh> refreshes;           // in time order, from the first frame on
  std::shared_ptr<std::size_t> room_bytes;  // for frames of all logs of the run
  bool full = false;                        // nothing more is kept

  /// False: the room is used up.
  [[nodiscard]] bool take_room(std::size_t bytes) {
    full = full || bytes > *room_bytes;
    if (!full) *room_bytes -= bytes;
    return !full;
  }
};

/// Frames of a longer run would not fit into memory.
inline constexpr std::size_t max_display_bytes = std::size_t{1} << 30;

/// Age of the pose behind the frame on show at each refresh; NaN at rest. A rest does not count
/// afterwards either: the camera was still there.
std::vector<double> pose_ages_ms(const DisplayLog& log);

/// Freezes while the camera moves, as W3C's webrtc-stats defines them: no new frame for the longer
/// of 3 d and d + 150 ms, where d is the mean of the last 30 intervals. The whole interval counts.
std::vector<double> freezes_ms(const DisplayLog& log);

/// A refresh judged by the exact picture of the visitor's camera.
struct JudgedRefresh {
  double at_s = 0.0;  // since the first one
  double ssim = 0.0;  // of luma
  double psnr_db = 0.0;
  double uncovered = 0.0;     // share of the view
  double age_ms = 0.0;        // of the pose behind the frame; NaN at rest
  bool sampled = false;       // one of every k; false: judged only for the time to a sharp picture
  int rest = 0;               // counted from 1
  std::int64_t after_us = 0;  // at rest: since the last pose that moved
};

}  // namespace catgs::load

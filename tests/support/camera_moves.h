#pragma once

#include <algorithm>
#include <string>
#include <vector>

#include <glm/gtc/quaternion.hpp>

#include "render_core/frame/renderer.h"
#include "render_core/motion/frame_groups.h"
#include "tests/support/test_scenes.h"

namespace catgs::test {

// Groups of frames on their forecast path, for the tests of every core's sub-frames.

/// A movement of the camera in its own axes.
struct Move {
  std::string name;
  glm::vec3 shift;     // world units
  glm::vec3 turn_rad;  // about x, y, z
};

inline Pose moved(const Pose& from, const Move& move) {
  return {from.position + from.orientation * move.shift,
          from.orientation * glm::quat(move.turn_rad)};
}

/// Long moves for a window of four frames: at 120 Hz, 3 m/s and 85 deg/s.
inline std::vector<Move> moves() {
  return {{"forward", {0, 0, 0.1f}, {0, 0, 0}},
          {"back", {0, 0, -0.1f}, {0, 0, 0}},
          {"sideways", {0.1f, 0.03f, 0}, {0, 0, 0}},
          {"yaw", {0, 0, 0}, {0, 0.05f, 0}},
          {"pitch", {0, 0, 0}, {-0.04f, 0, 0}},
          {"roll", {0, 0, 0}, {0, 0, 0.05f}},
          {"walk", {-0.05f, 0, 0.08f}, {0.02f, 0.03f, 0.01f}}};
}

inline constexpr int window = 4;

/// Groups of `window` sub-frames whatever the motion, so that long trails are tested too.
inline ViewSettings patient_settings() {
  ViewSettings settings{.pipeline = Pipeline::paper};
  settings.speculation = {
      .initial_window = window, .max_trail_px = 1e6f, .min_depth = 2.0f, .max_deviation_px = 0.5f};
  return settings;
}

/// Frame `k` of a group on its way along `move`.
inline FrameRequest request_on_path(const TestScene& scene, const Move& move, int k) {
  FrameRequest request = scene.request;
  const Pose start = scene.request.camera.world_from_camera, end = moved(start, move);
  request.camera.world_from_camera =
      uniform_motion(start, end, static_cast<float>(k) / static_cast<float>(window));
  request.forecast = Forecast{end, std::max(1, window - k)};
  return request;
}

}  // namespace catgs::test

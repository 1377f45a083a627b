#pragma once

// Pipeline::catgs against its exact pipeline at the same poses.

#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <utility>

#include <gtest/gtest.h>

#include "render_core/frame/renderer.h"
#include "render_core/metrics/image_quality.h"
#include "render_core/motion/predictor.h"
#include "render_core/motion/trajectory.h"
#include "tests/support/rendered.h"
#include "tests/support/test_scenes.h"

namespace catgs::test {

/// With windows wherever lists can hold, so that they are tested.
inline const ViewSettings catgs_settings = [] {
  ViewSettings settings{.pipeline = Pipeline::catgs, .speculation = following_speculation};
  settings.speculation.where_it_pays = false;
  return settings;
}();

inline FrameRequest request_at(const Pose& pose, glm::ivec2 size_px = {320, 192}) {
  FrameRequest request;
  request.camera = make_camera(pose, size_px, 300.0f);
  return request;
}

inline void add_opaque(GaussianCloud& cloud, glm::vec3 mean, glm::vec3 scale, glm::vec3 sh) {
  cloud.resize(cloud.size() + 1, 0);
  cloud.mean.back() = mean;
  cloud.scale.back() = scale;
  cloud.rotation.back() = glm::quat(1.0f, 0.0f, 0.0f, 0.0f);
  cloud.opacity.back() = 0.99f;
  cloud.sh.back() = sh;
}

/// A closed wall 4 units away, and 30,000 Gaussians behind it from 6 units on.
inline std::shared_ptr<const GaussianCloud> wall_before_many() {
  GaussianCloud cloud = random_cloud(30'000, 0, 11);
  for (glm::vec3& mean : cloud.mean) mean.z = 6.0f + std::abs(mean.z);
  constexpr int side = 40;
  for (const float z : {4.0f, 4.1f})
    for (int k = 0; k < side * side; ++k)
      add_opaque(
          cloud,
          {0.2f * static_cast<float>(k % side - 20), 0.2f * static_cast<float>(k / side - 20), z},
          {0.2f, 0.2f, 0.01f}, glm::vec3(k % 7 == 0 ? 1.0f : -0.5f));
  return std::make_shared<const GaussianCloud>(std::move(cloud));
}

/// A plate with an edge, and a pattern behind it that a frame without it would lack. It is in
/// several layers: a part may end some splats behind the one that finishes it.
inline std::shared_ptr<const GaussianCloud> plate_before_pattern() {
  GaussianCloud cloud;
  for (int layer = 0; layer < 6; ++layer) {
    for (int y = -20; y <= 20; ++y) {
      for (int x = -40; x <= 40; ++x) {
        const glm::vec2 at(x, y);
        add_opaque(cloud, {0.3f * at, 10.0f + 0.5f * static_cast<float>(layer)},
                   {0.2f, 0.2f, 0.01f}, glm::vec3((x + y) % 2 == 0 ? 1.5f : -1.5f));
        if (x <= 0 && layer < 2)
          add_opaque(cloud, {0.1f * at, 3.0f}, {0.07f, 0.07f, 0.01f}, glm::vec3(-0.5f));
      }
    }
  }
  return std::make_shared<const GaussianCloud>(std::move(cloud));
}

/// The quality of catgs along a path.
struct PathQuality {
  double squares = 0.0;
  double worst_frame = std::numeric_limits<double>::infinity();
  double worst_block = std::numeric_limits<double>::infinity();
  int frames = 0, sub_frames = 0;
  std::int64_t left_out = 0;  // list entries of exact that catgs did not have

  void follow(Renderer& renderer, const Trajectory& path) {
    const auto view = renderer.make_view(catgs_settings), exact = renderer.make_view({});
    const double rate_hz = 1e6 / static_cast<double>(path[1].time_us - path[0].time_us);
    MotionPredictor predictor{PredictorSettings{}};
    for (const TimedPose& sample : path) {
      predictor.add(sample);
      FrameRequest request;
      request.camera = make_camera(sample.world_from_camera, {320, 192}, 183.0f);
      request.forecast =
          predictor.forecast(sample.time_us, rate_hz, catgs_settings.speculation.initial_window);
      add(render_in(*view, request), render_in(*exact, request), request.camera.size_px);
    }
  }
  void add(const Rendered& drawn, const Rendered& expected, glm::ivec2 size_px) {
    const ImageQuality quality = compare_images({size_px, drawn.rgb}, {size_px, expected.rgb});
    left_out += static_cast<std::int64_t>(expected.stats.list_entries) -
                static_cast<std::int64_t>(drawn.stats.list_entries);
    squares += std::pow(10.0, -0.1 * quality.psnr());
    worst_frame = std::min(worst_frame, quality.psnr());
    worst_block = std::min(worst_block, quality.worst_block_psnr());
    ++frames;
    if (drawn.stats.kind == FrameKind::sub) ++sub_frames;
  }
  [[nodiscard]] double mean() const { return -10.0 * std::log10(squares / frames); }

  void expect_good() const {
    EXPECT_GE(mean(), 50.0);
    EXPECT_GE(worst_frame, 40.0);
    EXPECT_GE(worst_block, 30.0);
    // Lists for a window are longer.
    if (sub_frames == 0) {
      EXPECT_GT(left_out, 0);
    }
  }
};

}  // namespace catgs::test

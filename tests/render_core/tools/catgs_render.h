#pragma once

#include <cmath>
#include <string>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "render_core/motion/trajectory.h"
#include "render_core/scene/files/save_scene.h"
#include "tests/render_core/tools/run_catgs_render.h"
#include "tests/support/temporary_folder.h"

namespace catgs::test {

/// A ball of opaque Gaussians around the origin, seen from outside.
inline GaussianCloud ball() {
  constexpr std::size_t count = 400;
  GaussianCloud cloud;
  cloud.resize(count, 0);
  for (std::size_t i = 0; i < count; ++i) {
    const float t = static_cast<float>(i) + 0.5f;
    const float z = 1.0f - 2.0f * t / count;
    const float r = std::sqrt(1.0f - z * z);
    cloud.mean[i] = glm::vec3(r * std::cos(2.4f * t), r * std::sin(2.4f * t), z);
    cloud.rotation[i] = glm::quat(1, 0, 0, 0);
    cloud.scale[i] = glm::vec3(0.08f);
    cloud.opacity[i] = 0.9f;
    cloud.sh[i] = cloud.mean[i];
  }
  return cloud;
}

/// The program with a scene and a trace.
class CatgsRender : public ::testing::Test {
 protected:
  void SetUp() override {
    save_scene(ball(), folder_ / "ball.ply");
    write_tum(path("path.tum"), {{0, {glm::vec3(0, 0, -4), {1, 0, 0, 0}}},
                                 {500'000, {glm::vec3(0.2f, 0, -4), {1, 0, 0, 0}}},
                                 {1'000'000, {glm::vec3(0.4f, 0, -4), {1, 0, 0, 0}}}});
  }

  std::string path(const std::string& name) const { return (folder_ / name).string(); }
  std::string scene() const { return path("ball.ply"); }
  Outcome frames(const std::string& arguments) const {
    return run(fmt::format("frames {} --size 64x48 {}", scene(), arguments));
  }

  const TemporaryFolder folder_;
};

}  // namespace catgs::test

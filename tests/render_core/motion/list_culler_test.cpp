#include "render_core/motion/list_culler.h"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "render_core/math/camera-inl.h"
#include "render_core/math/ellipse-inl.h"
#include "render_core/math/projection-inl.h"
#include "tests/support/random_source.h"

namespace catgs {
namespace {

Camera camera_at(const Pose& pose) { return make_camera(pose, {320, 192}, 183.0f); }

class ListCullerTest : public ::testing::Test {
 protected:
  double uniform(double low, double high) { return random_.uniform(low, high); }
  glm::dvec3 direction() { return random_.direction(); }
  test::RandomSource random_{3};
};

// What a camera of the group shows is in a cluster that its key frame lists.
TEST_F(ListCullerTest, KeepsWhatSubFramesShow) {
  int shown = 0, culled = 0;
  for (int trial = 0; trial < 400; ++trial) {
    FrameGroups groups{{.max_trail_px = 64.0f}};
    const glm::quat first = glm::quat(glm::angleAxis(uniform(0.0, 3.0), direction()));
    // Far from the origin numbers are coarser.
    const glm::dvec3 origin = (trial % 4 == 0 ? 2000.0 : 1.0) * direction();
    const Camera key = camera_at({glm::vec3(origin), first});
    const Pose end{key.world_from_camera.position + glm::vec3(0.05 * direction()),
                   first * glm::quat(glm::angleAxis(uniform(0.0, 0.05), direction()))};
    const FramePlan plan = groups.plan(key, Forecast{end, 4}, 2.0f);
    if (plan.window == 0) continue;
    const float share = static_cast<float>(plan.window) / 4.0f;
    const Camera last = camera_at(uniform_motion(key.world_from_camera, end, share));
    const FramePlan sub = groups.plan(last, Forecast{last.world_from_camera, 4}, 2.0f);
    if (sub.kind != FrameKind::sub) continue;
    const ListCuller culler(key, plan);
    const auto now = math::make_camera_model(last);
    for (int i = 0; i < 400; ++i) {
      const double sigma = std::exp(uniform(std::log(0.001), std::log(0.5)));
      const glm::dvec3 mean = glm::dvec3(glm::vec3(glm::dvec3(key.world_from_camera.position) +
                                                   12.0 * uniform(0.0, 1.0) * direction()));
      ClusterBounds bounds;
      bounds.add(glm::vec3(mean), sigma, 0.0f);
      const bool outside = culler.outside(bounds.cluster());
      culled += outside ? 1 : 0;
      const math::Vec3<double> world{mean.x, mean.y, mean.z};
      const double depth = math::view_depth(now, world);
      if (depth < now.near_z) continue;
      const double rotation[4] = {0, 0, 0, 1};
      const auto splat = math::project(
          now, world, math::covariance_factor<double>(rotation, {sigma, sigma, sigma}), depth);
      const auto half = math::half_extent(splat, math::reach_of(0.0));
      const auto& at = splat.centre_px;
      if (at.x + half.x < 0.5 || at.y + half.y < 0.5 || at.x - half.x > 319.5 ||
          at.y - half.y > 191.5)
        continue;
      ++shown;
      EXPECT_FALSE(outside) << "depth " << depth << ", at " << at.x << ", " << at.y << ", sigma "
                            << sigma;
    }
  }
  EXPECT_GT(shown, 10'000);
  EXPECT_GT(culled, 10'000);
}

TEST_F(ListCullerTest, LeavesOutWhatIsBesideThePicture) {
  const Camera key = camera_at({});
  FrameGroups groups{SpeculationSettings{}};
  const FramePlan plan =
      groups.plan(key, Forecast{{{0.0f, 0.0f, 0.01f}, glm::quat(1.0f, 0.0f, 0.0f, 0.0f)}, 4}, 2.0f);
  ASSERT_GT(plan.window, 0);
  const ListCuller culler(key, plan);
  const auto outside = [&](float slope_y, float depth) {
    ClusterBounds bounds;
    bounds.add(depth * glm::vec3(0.0f, slope_y, 1.0f), 0.01, 0.0f);
    return culler.outside(bounds.cluster());
  };
  for (const float depth : {1.0f, 10.0f, 100.0f}) {
    EXPECT_FALSE(outside(0.5f, depth)) << depth;  // the picture ends at 0.52, its corners at 1.02
    EXPECT_TRUE(outside(0.8f, depth)) << depth;
    EXPECT_TRUE(outside(-0.8f, depth)) << depth;
  }
}

}  // namespace
}  // namespace catgs

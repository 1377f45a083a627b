#include "render_core/scene/analysis/robust_bounds.h"

#include <gtest/gtest.h>

#include "tests/support/surface_clouds.h"

namespace catgs::test {
namespace {

TEST(RobustBounds, OutliersAndTransparentGaussiansAreIgnored) {
  GaussianCloud cloud = room();
  for (std::size_t i = 0; i < 1000; ++i) cloud.mean[i] = glm::vec3(500.0f, 0.0f, 0.0f);
  for (std::size_t i = 1000; i < 20000; ++i) {
    cloud.mean[i].y = -40.0f;
    cloud.opacity[i] = 0.01f;
  }
  const Bounds bounds = *robust_bounds(cloud);
  EXPECT_NEAR(bounds.min.x, -4.0f, 0.1f);
  EXPECT_NEAR(bounds.max.x, 4.0f, 0.1f);
  EXPECT_NEAR(bounds.min.y, -1.5f, 0.1f);
  EXPECT_FALSE(robust_bounds(GaussianCloud{}).has_value());
}

}  // namespace
}  // namespace catgs::test

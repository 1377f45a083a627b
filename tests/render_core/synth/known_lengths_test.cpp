// Lengths between places that rays find, which the page measures by, against those of the plan.

#include <gtest/gtest.h>

#include "render_core/scene/analysis/surface_points.h"
#include "render_core/synth/city_plan.h"
#include "render_core/synth/synth.h"

namespace catgs {
namespace {

// At 9 m nothing but window reveals interrupts the fronts: trees and balconies are lower or higher.
TEST(KnownLengths, AStreetIsAsWideAsItsPlanSays) {
  ThreadPool pool(2);
  const Scene scene = synthesize(SynthKind::city, 300'000, 1, pool);
  const SurfacePoints surface(scene.cloud, pool);
  const float width = synth::street_width_x(0);
  for (float z = -62.0f; z <= -26.0f; z += 6.0f) {
    const glm::vec3 middle(0.0f, -9.0f, z);
    const auto east = surface.hit_along(middle, {1, 0, 0});
    const auto west = surface.hit_along(middle, {-1, 0, 0});
    ASSERT_TRUE(east && west) << z;
    EXPECT_NEAR(east->distance + west->distance, width, 0.01f * width) << z;
  }
}

}  // namespace
}  // namespace catgs

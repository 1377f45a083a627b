#include "render_core/cpu/occlusion.h"

#include <algorithm>
#include <random>

#include <gtest/gtest.h>

#include "render_core/cpu/kernels.h"
#include "tests/support/test_scenes.h"

namespace catgs::test {
namespace {

TEST(Occlusion, SpreadLimitsAreTheDeepestOfNeighbours) {
  const Camera camera = make_camera({}, {163, 91}, 100.0f);
  const glm::ivec2 tiles = (camera.size_px + (tile_size_px - 1)) / tile_size_px;
  ThreadPool pool(2);
  Occlusion occlusion;
  occlusion.begin(camera, 0.1f, simd_kernels().front(), pool);
  std::mt19937 random(3);
  std::uniform_real_distribution<float> depth(1.0f, 100.0f);
  for (int y = 0; y < tiles.y; ++y)
    for (int x = 0; x < tiles.x; ++x) {
      const PartEnds ends = occlusion.ends_of_tile({x, y});
      for (int row = 0; row < parts_across; ++row)
        for (int column = 0; column < parts_across; ++column)
          ends.first[row * ends.stride + column] = depth(random);
    }
  occlusion.finish();
  occlusion.begin(camera, 0.1f, simd_kernels().front(), pool);
  const DepthLimits limits = occlusion.limits();
  ASSERT_TRUE(limits);
  glm::ivec2 size = (camera.size_px + (part_side_px - 1)) / part_side_px;
  for (int level = 0; level < limits.levels; ++level, size = (size + 1) / 2)
    for (int y = 0; y < size.y; ++y)
      for (int x = 0; x < size.x; ++x)
        for (int spread = 1; spread < DepthLimits::spreads; ++spread) {
          const int last_x = (spread & DepthLimits::right) != 0 ? std::min(x + 1, size.x - 1) : x;
          const int last_y = (spread & DepthLimits::below) != 0 ? std::min(y + 1, size.y - 1) : y;
          float deepest = 0.0f;
          for (int row = y; row <= last_y; ++row)
            for (int column = x; column <= last_x; ++column)
              deepest = std::max(deepest, limits.at(level, column, row));
          ASSERT_EQ(limits.at(spread * limits.levels + level, x, y), deepest)
              << spread << " at " << level << " " << x << " " << y;
        }
}

}  // namespace
}  // namespace catgs::test

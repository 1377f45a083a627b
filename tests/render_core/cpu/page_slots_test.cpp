#include "render_core/cpu/page_slots.h"

#include <algorithm>
#include <cstdint>
#include <cstring>

#include <gtest/gtest.h>

namespace catgs {
namespace {

/// A node of so many Gaussians at (1, 2, 3).
void fill(TreePage& page, std::size_t slot, std::uint32_t count) {
  page.facts(slot).units = {1.0f, {}};
  page.facts(slot).count = count;
  const PackedGeometry g{{1, 2, 3}, 0, 0, {1, 1, 1}, 0, 0};
  for (std::uint32_t i = 0; i < std::min<std::uint32_t>(count, cluster_size); ++i)
    std::memcpy(&page.block(slot)[packed_offset(0, 16, i)], &g, 16);
}

TEST(PageSlots, SlotsThatTheTreeHasNotAreNotRead) {
  const TreeShape shape(100, 0);  // one leaf
  TreePage page(shape);
  fill(page, 0, 100);
  fill(page, 1, 7);
  fill(page, 2, cluster_size + 1);
  fill(page, 30, ~0u);
  PageSlots slots(shape, SplatModel::standard, 1);
  slots.put(0, page, 0);
  const auto clusters = slots.store().clusters();
  EXPECT_EQ(clusters[0].centre, glm::vec3(1, 2, 3));
  for (std::size_t c = 1; c < shape.slots(); ++c) EXPECT_EQ(clusters[c].centre, glm::vec3(0)) << c;
}

}  // namespace
}  // namespace catgs

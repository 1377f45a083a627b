#include "render_core/scene/tree/tree_shape.h"

#include <set>
#include <utility>

#include <gtest/gtest.h>

namespace catgs {
namespace {

TEST(TreeShape, EveryNodeHasASlotOfItsOwnBesideItsFamily) {
  for (const std::uint64_t leaves : {1, 2, 3, 8, 9, 16, 17, 129, 1000})
    for (const int degree : {0, 3}) {
      SCOPED_TRACE(testing::Message() << leaves << " leaves, degree " << degree);
      const TreeShape shape(leaves * cluster_size - 7, degree);
      ASSERT_EQ(shape.leaves(), leaves);
      std::set<std::pair<std::uint64_t, std::size_t>> positions;
      for (int level = 0; level < shape.levels(); ++level)
        for (std::uint32_t i = 0; i < shape.nodes_on(level); ++i) {
          const NodeId node{static_cast<std::uint8_t>(level), i};
          const std::uint64_t page = shape.page_of(node);
          const std::size_t slot = shape.slot_of(node);
          ASSERT_LT(page, shape.pages());
          ASSERT_LT(slot, shape.slots());
          ASSERT_TRUE(positions.emplace(page, slot).second);
          if (slot == 0) {
            ASSERT_EQ(shape.root_of(page), node);
          }
          if (level + 1 == shape.levels()) continue;
          const NodeId parent{static_cast<std::uint8_t>(level + 1), i / 2};
          if (shape.page_of(parent) == page) {
            ASSERT_EQ(shape.slot_of(parent), (slot - 1) / 2);
          } else {
            ASSERT_EQ(slot, 0u);
            ASSERT_LT(shape.page_of(parent), page);  // coarse pages come first
            const std::uint64_t first = shape.page_of({node.level, i / 2 * 2});
            ASSERT_EQ(family_of(shape, page), first);
            ASSERT_EQ(family_size(shape, first), i / 2 * 2 + 1 < shape.nodes_on(level) ? 2u : 1u);
          }
        }
      EXPECT_EQ(shape.nodes_on(shape.levels() - 1), 1u);
      EXPECT_EQ(shape.page_of(shape.root()), 0u);
    }
}

TEST(TreeShape, ThePagesHaveEachNodeOnce) {
  for (const std::uint64_t leaves : {1, 2, 3, 9, 17, 129, 1000})
    for (const int degree : {0, 3}) {
      SCOPED_TRACE(testing::Message() << leaves << " leaves, degree " << degree);
      const TreeShape shape(leaves * cluster_size - 7, degree);
      std::set<std::pair<int, std::uint32_t>> nodes;
      for (std::uint64_t page = 0; page < shape.pages(); ++page)
        for_each_node_in(shape, page, [&](NodeId node) {
          ASSERT_EQ(shape.page_of(node), page);
          ASSERT_EQ(shape.slot_of(node) == 0, node == shape.root_of(page));
          ASSERT_LT(node.index, shape.nodes_on(node.level));
          ASSERT_TRUE(nodes.emplace(node.level, node.index).second);
        });
      std::size_t count = 0;
      for (int level = 0; level < shape.levels(); ++level) count += shape.nodes_on(level);
      EXPECT_EQ(nodes.size(), count);
      for (std::uint64_t page = 1; page < shape.pages(); ++page)
        EXPECT_LT(shape.page_of(refined_by(shape, page)), page);
    }
}

TEST(TreeShape, PagesAreAboutAQuarterOfAMegabyte) {
  for (int degree = 0; degree <= max_sh_degree; ++degree) {
    const TreeShape shape(1'000'000, degree);
    EXPECT_GE(shape.page_bytes(), 200u << 10);
    EXPECT_LE(shape.page_bytes(), 340u << 10);
    EXPECT_EQ(shape.page_offset(1) % TreeShape::page_alignment, 0u);
  }
}

TEST(TreeShape, LargestSceneFits) {
  const TreeShape shape(TreeShape::max_gaussians, 3);
  EXPECT_EQ(shape.levels(), 27);
  EXPECT_EQ(shape.page_of({0, shape.leaves() - 1}), shape.pages() - 1);
}

}  // namespace
}  // namespace catgs

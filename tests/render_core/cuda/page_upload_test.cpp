#include "render_core/cuda/page_upload.h"

#include <algorithm>
#include <cstring>
#include <limits>
#include <memory>
#include <vector>

#include <gtest/gtest.h>

#include "tests/render_core/scene/tree/tree_test_support.h"
#include "tests/support/test_scenes.h"

namespace catgs::cuda {
namespace {

TEST(PageUpload, SlotsThatTheTreeHasNotHaveNoError) {
  const TreeShape shape(cluster_size + 100, 0);  // two leaves
  TreePage page(shape);
  for (std::size_t slot = 0; slot < shape.slots(); ++slot) {
    page.facts(slot).error = 1.0f;
    page.facts(slot).count = 300;
    page.facts(slot).bounds.reach = std::numeric_limits<float>::quiet_NaN();
  }
  const PageUpload upload(shape, page, 0);
  for (std::size_t slot = 0; slot < clusters_per_slot; ++slot) {
    EXPECT_EQ(upload.errors[slot], slot < 3 ? 1.0f : -1.0f) << slot;
    EXPECT_EQ(upload.clusters[slot].reach == 0.0f, slot >= 3) << slot;
  }
}

TEST(PageUpload, RecordsBehindTheCountAreInvisible) {
  const TreeShape shape(100, 1);
  TreePage page(shape);
  page.facts(0).count = 100;
  const PageUpload upload(shape, page, 0);
  ASSERT_EQ(upload.blocks.size(), shape.slots() * shape.block_bytes());
  for (std::uint32_t i = 0; i < cluster_size; ++i) {
    PackedGeometry g;
    std::memcpy(&g, &upload.blocks[packed_offset(0, 16, i)], 16);
    EXPECT_EQ(g.log2_opacity, i < 100 ? 0 : 65535) << i;
  }
}

TEST(PageUpload, SharesAreThoseOfTheWalk) {
  ThreadPool pool(2);
  TreeFile tree(test::source_of(test::tree_bytes(test::random_cloud(60'000, 3, 31), pool)));
  const TreeShape& shape = tree.shape();
  PageTable table(shape);
  const std::uint64_t pages = shape.pages();
  std::vector<float> errors(pages * clusters_per_slot), shares(errors.size());
  std::vector<Cluster> clusters(errors.size());
  for (std::uint64_t p = 0; p < pages; ++p) {
    const auto page = tree.page(p, table.facts_above(p));
    ASSERT_NE(page, nullptr);
    auto held = std::make_shared<PageInSlot>();
    held->page = p;
    held->slot = static_cast<std::uint32_t>(pages - 1 - p);
    held->shown_since_s = -1e9;
    for (std::size_t s = 0; s < shape.slots(); ++s) held->facts.push_back(page->facts(s));
    const PageUpload upload(shape, *page, p);
    std::ranges::copy(upload.errors, &errors[held->slot * clusters_per_slot]);
    std::ranges::copy(upload.clusters, &clusters[held->slot * clusters_per_slot]);
    table.add(std::move(held));
  }
  const std::vector<PageEntry> entries = entries_of(table);
  for (const float distance : {3.0f, 10.0f, 40.0f, 160.0f}) {
    const Camera camera =
        make_camera(test::look_at({0, 0, 5 - distance}, {0, 0, 5}), {640, 360}, 500.0f);
    const TreeCut cut{.tree = {entries.data(), static_cast<std::uint32_t>(pages), errors.data()},
                      .now = CutEye(camera),
                      .end = CutEye(camera),
                      .detail_px = 0.7f,
                      .now_s = 0.0,
                      .share = shares.data()};
    const ClusterCuller culler(camera);
    std::vector<float> expected(shares.size());
    for (const auto& [node, share] : table.cut(std::span(&camera, 1), 0.7f, 0.0).drawn)
      expected[table.cluster_of(node, clusters_per_slot)] = share;
    int drawn = 0;
    for (std::uint32_t n = 0; n < cut.tree.nodes(); ++n) {
      const std::uint32_t c = cut.tree.cluster_of(n);
      const float share = cut.share_of(clusters.data(), n);
      if (share > 0.0f && culler.outside(clusters[c])) continue;  // the walk leaves it out
      EXPECT_NEAR(share, expected[c], 1e-3f) << n;
      drawn += share > 0.0f ? 1 : 0;
    }
    EXPECT_GT(drawn, 0);
  }
}

}  // namespace
}  // namespace catgs::cuda

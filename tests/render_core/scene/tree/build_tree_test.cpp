#include "render_core/scene/tree/build_tree.h"

#include <algorithm>
#include <numeric>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "render_core/base/error.h"
#include "render_core/scene/files/load_scene.h"
#include "render_core/scene/tree/read_tree.h"
#include "tests/render_core/scene/tree/tree_test_support.h"
#include "tests/support/test_scenes.h"

namespace catgs::test {
namespace {

TEST(BuildTree, TheBytesDependOnTheSceneAlone) {
  ThreadPool one(1), three(3);
  for (const int degree : {0, 3}) {
    const GaussianCloud cloud = random_cloud(20'000, degree, 3);
    const std::string bytes = tree_bytes(cloud, one);
    EXPECT_TRUE(bytes == tree_bytes(cloud, three)) << "threads";
    EXPECT_TRUE(bytes == tree_bytes(cloud, three, 0)) << "sorted on disk";
    EXPECT_TRUE(bytes == tree_bytes(cloud, three, 0, 999)) << "in parts";
  }
}

TEST(BuildTree, LeavesAreTheClustersThatTheCoresMake) {
  ThreadPool pool(2);
  const GaussianCloud cloud = random_cloud(5'000, 3, 4);
  TreeFile tree(source_of(tree_bytes(cloud, pool)));
  const auto order = morton_order(cloud.mean, pool);
  for (std::uint32_t l = 0; l < tree.shape().leaves(); ++l) {
    const std::size_t first = l * cluster_size;
    const auto members =
        std::span(order).subspan(first, std::min(cluster_size, order.size() - first));
    std::vector<std::byte> block(packed_block_bytes(3));
    const PackedCluster packed = pack_cluster(cloud, members, block);
    const auto page = tree.page(tree.shape().page_of({0, l}));
    const std::size_t slot = tree.shape().slot_of({0, l});
    ASSERT_TRUE(std::ranges::equal(page->block(slot), block)) << "leaf " << l;
    ASSERT_EQ(page->facts(slot).units.factor, packed.units.factor);
    ASSERT_EQ(page->facts(slot).bounds.reach, packed.bounds.reach);
    ASSERT_EQ(page->facts(slot).count, members.size());
  }
}

TEST(BuildTree, LevelsGetCoarserAndTheHeaderCountsThem) {
  ThreadPool pool(2);
  TreeFile tree(source_of(tree_bytes(random_cloud(100'000, 0, 5), pool)));
  const TreeShape& shape = tree.shape();
  ASSERT_EQ(shape.levels(), 10);  // 391 leaves
  EXPECT_EQ(tree.header().dropped, 3u);
  EXPECT_EQ(tree.header().read, 100'003u);
  for (int level = 0; level < shape.levels(); ++level) {
    std::uint64_t gaussians = 0;
    float max_error = 0.0f;
    for (std::uint32_t i = 0; i < shape.nodes_on(level); ++i) {
      const NodeId node{static_cast<std::uint8_t>(level), i};
      const NodeFacts facts = tree.page(shape.page_of(node))->facts(shape.slot_of(node));
      gaussians += facts.count;
      max_error = std::max(max_error, facts.error);
    }
    const TreeLevel& said = tree.header().levels[static_cast<std::size_t>(level)];
    EXPECT_EQ(said.gaussians, gaussians);
    EXPECT_EQ(said.max_error, max_error);
    if (level == 0) {
      EXPECT_EQ(gaussians, 100'000u);
      EXPECT_EQ(max_error, 0.0f);
    } else {
      const TreeLevel& below = tree.header().levels[static_cast<std::size_t>(level - 1)];
      EXPECT_LT(said.gaussians, below.gaussians);
      EXPECT_GT(said.mean_error, below.mean_error);
    }
  }
}

TEST(BuildTree, TreesLoadAsTheScenesTheyWereMadeFrom) {
  ThreadPool pool(2);
  const GaussianCloud cloud = random_cloud(3'000, 2, 6);
  const TemporaryFolder folder;
  const Scene scene = load_scene(folder.write("a.tree", tree_bytes(cloud, pool)));
  EXPECT_EQ(scene.format, "tree");
  EXPECT_TRUE(scene.notes.empty());
  EXPECT_EQ(scene.report.dropped, 0u);
  EXPECT_EQ(scene.report.repaired, 0u);
  const auto order = morton_order(cloud.mean, pool);
  ASSERT_EQ(scene.cloud.size(), cloud.size());
  for (std::size_t i = 0; i < order.size(); ++i) {
    ASSERT_EQ(scene.cloud.mean[i], cloud.mean[order[i]]);
    ASSERT_NEAR(scene.cloud.opacity[i], cloud.opacity[order[i]], 8e-4f);
    ASSERT_NEAR(scene.cloud.sh_of(i)->r, cloud.sh_of(order[i])->r, 2e-3f);
  }
}

// What a scene's faintest Gaussians become by rounding is not below what sanitize() keeps.
TEST(BuildTree, FaintGaussiansAreNotLost) {
  ThreadPool pool(1);
  GaussianCloud cloud = random_cloud(600, 0, 7);
  for (std::size_t i = 0; i < cloud.size(); ++i)
    cloud.opacity[i] = (1.0f + 1e-6f * static_cast<float>(i)) / 255.0f;
  const TemporaryFolder folder;
  EXPECT_EQ(load_scene(folder.write("a.tree", tree_bytes(cloud, pool))).cloud.size(), 600u);
}

TEST(BuildTree, EmptyScenesAreRefusedAndLeaveNoFile) {
  ThreadPool pool(1);
  const TemporaryFolder folder;
  const SceneParts nothing{[](const auto&) { return 0; }, "none"};
  EXPECT_THROW(build_tree(nothing, folder / "a.tree", 0, pool, LoadContext(pool)), InputError);
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
}

}  // namespace
}  // namespace catgs::test

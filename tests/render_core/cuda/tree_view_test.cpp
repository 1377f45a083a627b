// Scenes in pages in the CUDA core; needs a device.

#include "tests/render_core/cuda/device.h"
#include "tests/support/forged_trees.h"
#include "tests/support/tree_views.h"

namespace catgs {
namespace {

constexpr RendererKind kind = RendererKind::cuda;

TEST(CudaFrames, ZeroDetailIsTheWholeScene) {
  REQUIRE_DEVICE();
  test::expect_zero_detail_is_the_whole_scene(kind, 50.0);
}

TEST(CudaFrames, DetailLeavesOutLittle) {
  REQUIRE_DEVICE();
  test::expect_detail_to_leave_out_little(kind);
}

TEST(CudaFrames, NothingPopsWhereNodesGiveWay) {
  REQUIRE_DEVICE();
  test::expect_no_pops(kind);
}

TEST(CudaFrames, ShortMemoryIsCoarser) {
  REQUIRE_DEVICE();
  test::expect_short_memory_to_be_coarser(kind);
}

TEST(CudaFrames, SubFramesKeepTheCut) {
  REQUIRE_DEVICE();
  test::expect_sub_frames_to_keep_the_cut(kind);
}

TEST(CudaFrames, TreesShareAPool) {
  REQUIRE_DEVICE();
  test::expect_trees_to_share_a_pool(kind);
}

TEST(CudaFrames, AViewAtRestSettles) {
  REQUIRE_DEVICE();
  test::expect_a_resting_view_to_settle(kind);
}

TEST(CudaFrames, UnusedSlotsThatClaimToBeUsedAreRefused) {
  REQUIRE_DEVICE();
  test::expect_unused_slots_to_be_refused(kind);
}

TEST(CudaFrames, ExtremePagesAreDrawn) {
  REQUIRE_DEVICE();
  test::expect_extreme_pages_to_be_drawn(kind);
}

TEST(CudaFrames, RandomPagesAreDrawnOrRefused) {
  REQUIRE_DEVICE();
  test::expect_random_pages_to_be_drawn_or_refused(kind, 60);
}

TEST(CudaFrames, VanillaIsRefusedForPages) {
  REQUIRE_DEVICE();
  test::expect_vanilla_to_be_refused(kind);
}

TEST(CudaFrames, CutsAreThoseOfTheCpuCore) {
  REQUIRE_DEVICE();
  const test::TreeScenes scenes;
  const auto cuda = scenes.in_pages(kind), cpu = scenes.in_pages(RendererKind::cpu);
  for (const float distance : {3.0f, 25.0f, 60.0f, 200.0f}) {
    const FrameRequest request = test::tree_request(distance, 3.0f);
    const test::Rendered drawn = test::render_in(*cuda->make_view({}), request);
    const test::Rendered expected = test::render_in(*cpu->make_view({}), request);
    EXPECT_NEAR(drawn.stats.nodes, expected.stats.nodes, 2 + expected.stats.nodes / 100);
    EXPECT_NEAR(drawn.stats.finest_level, expected.stats.finest_level, 1);
    EXPECT_NEAR(drawn.stats.coarsest_level, expected.stats.coarsest_level, 1);
    EXPECT_GE(test::psnr_db(drawn.rgb, expected.rgb), 50.0) << "from " << distance;
  }
}

}  // namespace
}  // namespace catgs

// Scenes in pages in the CPU core.

#include "tests/support/forged_trees.h"
#include "tests/support/tree_views.h"

namespace catgs {
namespace {

constexpr RendererKind kind = RendererKind::cpu;

TEST(TreeViews, ZeroDetailIsTheWholeScene) {
  test::expect_zero_detail_is_the_whole_scene(kind, 70.0);
}
TEST(TreeViews, DetailLeavesOutLittle) { test::expect_detail_to_leave_out_little(kind); }
TEST(TreeViews, NothingPops) { test::expect_no_pops(kind); }
TEST(TreeViews, ShortMemoryIsCoarser) { test::expect_short_memory_to_be_coarser(kind); }
TEST(TreeViews, SubFramesKeepTheCut) { test::expect_sub_frames_to_keep_the_cut(kind); }
TEST(TreeViews, TreesShareAPool) { test::expect_trees_to_share_a_pool(kind); }
TEST(TreeViews, AViewAtRestSettles) { test::expect_a_resting_view_to_settle(kind); }
TEST(TreeViews, UnusedSlotsThatClaimToBeUsedAreRefused) {
  test::expect_unused_slots_to_be_refused(kind);
}
TEST(TreeViews, ExtremePagesAreDrawn) { test::expect_extreme_pages_to_be_drawn(kind); }
TEST(TreeViews, RandomPagesAreDrawnOrRefused) {
  test::expect_random_pages_to_be_drawn_or_refused(kind, 60);
}
TEST(TreeViews, VanillaIsRefused) { test::expect_vanilla_to_be_refused(kind); }

TEST(TreeViews, TheReferenceDrawsNoParts) {
  const test::TreeScenes scenes;
  EXPECT_THROW((void)make_renderer(scenes.tree(), {.kind = RendererKind::reference, .pool = {}}),
               InputError);
}

}  // namespace
}  // namespace catgs

// Clip planes in the CUDA core; needs a device.

#include "tests/render_core/cuda/device.h"
#include "tests/support/clipped_views.h"

namespace catgs {
namespace {

constexpr RendererKind kind = RendererKind::cuda;

TEST(CudaClipPlane, PicturesAreThoseOfTheRest) {
  REQUIRE_DEVICE();
  test::expect_clipped_pictures_to_be_those_of_the_rest(
      kind, {Pipeline::vanilla, Pipeline::exact, Pipeline::paper, Pipeline::catgs});
}

TEST(CudaClipPlane, AClippedWallHidesNothing) {
  REQUIRE_DEVICE();
  test::expect_a_clipped_wall_to_hide_nothing(kind);
}

TEST(CudaClipPlane, AnotherPlaneEndsAWindow) {
  REQUIRE_DEVICE();
  test::expect_another_clip_plane_to_end_a_window(kind);
}

TEST(CudaClipPlane, TreesAreClipped) {
  REQUIRE_DEVICE();
  test::expect_trees_to_be_clipped(kind);
}

}  // namespace
}  // namespace catgs

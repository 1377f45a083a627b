// Clip planes in the CPU core, and in the reference.

#include "tests/support/clipped_views.h"

namespace catgs {
namespace {

constexpr RendererKind kind = RendererKind::cpu;

TEST(ClipPlane, PicturesAreThoseOfTheRest) {
  test::expect_clipped_pictures_to_be_those_of_the_rest(
      kind, {Pipeline::vanilla, Pipeline::exact, Pipeline::paper, Pipeline::catgs});
  test::expect_clipped_pictures_to_be_those_of_the_rest(RendererKind::reference, {Pipeline::exact});
}
TEST(ClipPlane, AClippedWallHidesNothing) { test::expect_a_clipped_wall_to_hide_nothing(kind); }
TEST(ClipPlane, AnotherPlaneEndsAWindow) { test::expect_another_clip_plane_to_end_a_window(kind); }
TEST(ClipPlane, TreesAreClipped) { test::expect_trees_to_be_clipped(kind); }

TEST(ClipPlane, HasToBeFinite) {
  const auto renderer = test::renderer_of_kind(kind, test::random_cloud(10, 0, 1));
  FrameRequest request = test::request_at({});
  request.camera.clip.offset = std::numeric_limits<float>::infinity();
  FrameView frame;
  const RenderStatus status = renderer->make_view({})->render(request, frame);
  EXPECT_EQ(status.code, RenderStatus::Code::invalid_request);
  EXPECT_NE(status.message.find("clip plane"), std::string::npos);
}

}  // namespace
}  // namespace catgs

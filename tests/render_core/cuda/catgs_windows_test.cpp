// Windows of Pipeline::catgs: what ends them, and what they draw meanwhile.

#include <algorithm>
#include <functional>
#include <memory>
#include <utility>
#include <vector>

#include "tests/render_core/cores/core_test.h"
#include "tests/support/catgs_views.h"

namespace catgs::test {
namespace {

class CatgsWindows : public CoreTest {
 protected:
  /// Frame `k` of a walk to the side, with its true future as the forecast.
  static FrameRequest on_walk(int k, glm::vec3 step = {0.004f, 0.0f, 0.002f}) {
    const auto at = [&](int frame) { return Pose{step * static_cast<float>(frame), {1, 0, 0, 0}}; };
    FrameRequest request = request_at(at(k));
    request.forecast = Forecast{at(k + 8), 8};
    return request;
  }

  /// Draws frames until one is a sub-frame, and returns the number of the next.
  static int open_window(View& view) {
    for (int k = 0; k < 8; ++k)
      if (render_in(view, on_walk(k)).stats.kind == FrameKind::sub) return k + 1;
    ADD_FAILURE() << "no frame was a sub-frame";
    return 8;
  }
};

TEST_F(CatgsWindows, AnotherPictureEndsTheWindow) {
  const auto renderer = core_renderer_of(plate_before_pattern());
  const auto exact = renderer->make_view({});
  const std::vector<std::function<void(FrameRequest&)>> changes = {
      [](FrameRequest& r) {
        r.camera = make_camera(r.camera.world_from_camera, {200, 300}, 300.0f);
      },
      [](FrameRequest& r) { r.camera.focal_px *= 1.3f; },
      [](FrameRequest& r) { r.camera.clip.high[2] = 11.0f; },
      [](FrameRequest& r) {
        r.camera = make_orthographic_camera(r.camera.world_from_camera, {320, 192}, 6.0f);
      },
      [](FrameRequest& r) { r.forecast.reset(); }};
  for (std::size_t i = 0; i < changes.size(); ++i) {
    SCOPED_TRACE(i);
    const auto view = renderer->make_view(catgs_settings);
    const int next = open_window(*view);
    for (int k = next; k < next + 4; ++k) {
      FrameRequest request = on_walk(k);
      changes[i](request);
      const Rendered drawn = render_in(*view, request), expected = render_in(*exact, request);
      if (k == next) {
        EXPECT_EQ(drawn.stats.kind, FrameKind::key);
      }
      EXPECT_GE(psnr_db(drawn.rgb, expected.rgb), 45.0) << k;
    }
  }
}

// A wall far away decides how far the camera may leave its forecast. Near Gaussians then leave
// their lists.
TEST_F(CatgsWindows, ASubFrameThatWouldMissNearGaussiansIsAKeyFrame) {
  GaussianCloud cloud = *wall_before_many();
  for (int k = 0; k < 900; ++k)
    add_opaque(
        cloud,
        {0.01f * static_cast<float>(k % 30 - 15), 0.01f * static_cast<float>(k / 30 - 15), 0.5f},
        {0.002f, 0.002f, 0.002f}, glm::vec3(1.0f));
  const auto renderer = core_renderer_of(std::make_shared<const GaussianCloud>(std::move(cloud)));
  const auto exact = renderer->make_view({});
  for (const bool strays : {false, true}) {
    const auto view = renderer->make_view(catgs_settings);
    FrameRequest request = request_at({});
    request.forecast = Forecast{request.camera.world_from_camera, 8};
    for (int k = 0; k < 2; ++k) render_in(*view, request);
    // 300 px * 0.016 / 0.5 = 9.6 px near by, 1.2 px at the wall, and 3 px at the mean depth.
    if (strays) request.camera.world_from_camera.position.x = 0.016f;
    const Rendered drawn = render_in(*view, request);
    EXPECT_EQ(drawn.stats.kind, strays ? FrameKind::key : FrameKind::sub);
    EXPECT_EQ(drawn.stats.cut_window, strays);
    EXPECT_GE(psnr_db(drawn.rgb, render_in(*exact, request).rgb), 40.0);
  }
}

TEST_F(CatgsWindows, ViewsOfOneSceneKeepTheirOwn) {
  const auto renderer = core_renderer_of(plate_before_pattern());
  const glm::vec3 steps[] = {{0.004f, 0.0f, 0.002f}, {-0.02f, 0.01f, 0.0f}, {0.0f, 0.0f, 0.0f}};
  std::vector<std::unique_ptr<View>> together;
  for (std::size_t i = 0; i < std::size(steps); ++i)
    together.push_back(renderer->make_view(catgs_settings));
  std::vector<std::vector<Rendered>> drawn(std::size(steps));
  for (int k = 0; k < 12; ++k)
    for (std::size_t i = 0; i < std::size(steps); ++i)
      drawn[i].push_back(render_in(*together[i], on_walk(k, steps[i])));
  for (std::size_t i = 0; i < std::size(steps); ++i) {
    const auto alone = renderer->make_view(catgs_settings);
    for (int k = 0; k < 12; ++k) {
      const Rendered expected = render_in(*alone, on_walk(k, steps[i]));
      EXPECT_EQ(drawn[i][k].stats.kind, expected.stats.kind);
      EXPECT_GE(psnr_db(drawn[i][k].rgb, expected.rgb), 60.0);
    }
  }
}

// A room of the city is entered and left through a doorway: a frame of the wall, and what lies
// behind it.
TEST_F(CatgsWindows, ThingsBehindADoorAreThereAtOnce) {
  GaussianCloud cloud = *plate_before_pattern();
  for (int y = -30; y <= 30; ++y)
    for (int x = -60; x <= 60; ++x)
      if (std::abs(x) > 6 || y < -8)
        for (const float z : {1.5f, 1.6f})
          add_opaque(cloud, {0.05f * static_cast<float>(x), 0.05f * static_cast<float>(y), z},
                     {0.04f, 0.04f, 0.01f}, glm::vec3(-0.8f));
  const auto renderer = core_renderer_of(std::make_shared<const GaussianCloud>(std::move(cloud)));
  const auto view = renderer->make_view(catgs_settings), exact = renderer->make_view({});
  for (const float rate_hz : {120.0f, 60.0f, 30.0f}) {
    SCOPED_TRACE(rate_hz);
    PathQuality quality;
    const int there = static_cast<int>(2.2f * rate_hz / 1.4f);  // at 1.4 m/s
    MotionPredictor predictor{PredictorSettings{}};
    for (int k = 0; k < 2 * there; ++k) {
      const float way = 1.4f / rate_hz * static_cast<float>(k < there ? k : 2 * there - k);
      const Pose pose{{0.1f * way, 0, way}, {1, 0, 0, 0}};
      const auto now_us = static_cast<std::int64_t>(1e6 * k / rate_hz);
      predictor.add({now_us, pose});
      FrameRequest request = request_at(pose);
      request.forecast = predictor.forecast(now_us, rate_hz, 12);
      quality.add(render_in(*view, request), render_in(*exact, request), request.camera.size_px);
    }
    EXPECT_GE(quality.mean(), 50.0);
    EXPECT_GE(quality.worst_frame, 40.0);
    EXPECT_GE(quality.worst_block, 30.0);
    EXPECT_GT(quality.sub_frames, 0);
  }
}

}  // namespace
}  // namespace catgs::test

// Pictures of two eyes side by side, against the pictures of each eye alone.
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <utility>
#include <vector>

#include "tests/render_core/cores/tree_views.h"
#include "tests/support/catgs_views.h"
#include "tests/support/rendered.h"

namespace catgs::test {
namespace {

using StereoViews = CoreTest;

/// Eyes of a headset: wider outwards and downwards, 0.1 units apart, the right one a little higher.
const Stereo headset{Eye{{-0.05f, 0.01f}, {-1.0f, -0.7f}, {0.6f, 0.9f}},
                     Eye{{0.05f, -0.01f}, {-0.6f, -0.7f}, {1.0f, 0.9f}}};

FrameRequest stereo_request(const Pose& head, glm::ivec2 size_px = {320, 192},
                            const Stereo& eyes = headset) {
  FrameRequest request;
  request.camera.world_from_camera = head;
  request.camera.size_px = size_px;
  request.background = {0.1f, 0.2f, 0.3f};
  request.stereo = eyes;
  return request;
}

/// A request for one eye of a request for both.
FrameRequest request_of_eye(const FrameRequest& both, std::size_t eye) {
  FrameRequest request = both;
  request.camera = cameras_of(both)[eye];
  request.stereo.reset();
  request.depth_cells.x /= 2;
  return request;
}

/// The half of a picture that belongs to an eye.
std::vector<float> half_of(const std::vector<float>& rgb, glm::ivec2 size_px, std::size_t eye) {
  const auto row = static_cast<std::ptrdiff_t>(3 * size_px.x), half = row / 2;
  std::vector<float> pixels;
  for (auto at = rgb.begin() + static_cast<std::ptrdiff_t>(eye) * half; at < rgb.end(); at += row)
    pixels.insert(pixels.end(), at, at + half);
  return pixels;
}

/// Draws with both eyes in `view`, and with each alone in `left` and `right`.
void expect_halves_of(View& view, View& left, View& right, const FrameRequest& request,
                      double least_db) {
  const Rendered both = render_in(view, request);
  const Rendered alone[2] = {render_in(left, request_of_eye(request, 0)),
                             render_in(right, request_of_eye(request, 1))};
  EXPECT_EQ(both.stats.kind, FrameKind::key);
  for (std::size_t eye = 0; eye < 2; ++eye)
    EXPECT_GE(psnr_db(half_of(both.rgb, request.camera.size_px, eye), alone[eye].rgb), least_db)
        << (eye == 0 ? "left" : "right");
}

struct Bound {
  Pipeline pipeline;
  double least_db;
};
const std::vector<Bound> bounds{{Pipeline::exact, 60.0},
                                {Pipeline::catgs, 55.0},
                                {Pipeline::paper, 60.0},
                                {Pipeline::vanilla, 60.0}};

TEST_F(StereoViews, HalvesAreWhatEachEyeSees) {
  for (const TestScene& scene : small_scenes()) {
    SCOPED_TRACE(scene.name);
    const auto renderer = core_renderer_of(scene.cloud);
    FrameRequest request =
        stereo_request(scene.request.camera.world_from_camera, {2 * 75, 51});  // not whole tiles
    request.camera.near_z = scene.request.camera.near_z;
    for (const Bound& bound : bounds) {
      SCOPED_TRACE(static_cast<int>(bound.pipeline));
      const ViewSettings settings{.pipeline = bound.pipeline};
      const auto view = renderer->make_view(settings), left = renderer->make_view(settings),
                 right = renderer->make_view(settings);
      for (int frame = 0; frame < 2; ++frame)
        expect_halves_of(*view, *left, *right, request, bound.least_db);
    }
  }
}

// Colours that depend much on the direction, while the head moves as little as a View may reuse
// them.
TEST_F(StereoViews, ColoursAreThoseOfEachEye) {
  const auto renderer =
      core_renderer_of(std::make_shared<const GaussianCloud>(random_cloud(4'000, 3, 8)));
  const Stereo eyes{Eye{{-0.032f, 0.0f}, {-0.15f, -0.1f}, {0.1f, 0.1f}},
                    Eye{{0.032f, 0.0f}, {-0.1f, -0.1f}, {0.15f, 0.1f}}};
  FrameRequest request = stereo_request(look_at({0, 0, -15}, {0, 0, 5}), {320, 128}, eyes);
  for (const Bound& bound : bounds) {
    SCOPED_TRACE(static_cast<int>(bound.pipeline));
    const ViewSettings settings{.pipeline = bound.pipeline};
    const auto view = renderer->make_view(settings), left = renderer->make_view(settings),
               right = renderer->make_view(settings);
    for (const float step : {0.0f, 0.02f, 0.04f}) {
      request.camera.world_from_camera.position.x = step;
      expect_halves_of(*view, *left, *right, request, bound.least_db);
    }
  }
}

TEST_F(StereoViews, ExactPicturesEqualTheReference) {
  const auto cloud = std::make_shared<const GaussianCloud>(random_cloud(2'000, 3, 5));
  FrameRequest request = stereo_request({});
  request.depth_cells = {16, 8};
  const auto oracle = core_renderer_of(cloud, RendererKind::reference)->make_view({});
  const auto grid_of = [&](const FrameRequest& asked) {
    FrameView frame;
    EXPECT_TRUE(oracle->render(asked, frame).ok());
    return std::vector<float>(frame.depths.inverse_depths.begin(),
                              frame.depths.inverse_depths.end());
  };
  const std::vector<float> both = grid_of(request), left = grid_of(request_of_eye(request, 0));
  for (std::size_t i = 0; i < left.size(); ++i) ASSERT_EQ(both[i / 8 * 16 + i % 8], left[i]) << i;
  const Rendered expected = render_in(*oracle, request);
  EXPECT_GE(psnr_db(render_in(*core_renderer_of(cloud)->make_view({}), request).rgb, expected.rgb),
            60.0);
  for (std::size_t eye = 0; eye < 2; ++eye)
    EXPECT_EQ(half_of(expected.rgb, request.camera.size_px, eye),
              render_in(*oracle, request_of_eye(request, eye)).rgb);
}

TEST_F(StereoViews, HalvesOfMovingHeadsStayRight) {
  const auto renderer = core_renderer_of(wall_before_many());
  const auto view = renderer->make_view(catgs_settings), exact = renderer->make_view({});
  std::uint32_t drawn = 0, all = 0;
  for (int step = 0; step < 6; ++step) {
    const float turn = 0.02f * static_cast<float>(step);
    const Pose head{{turn, 0.0f, 0.0f},
                    glm::angleAxis(turn, glm::normalize(glm::vec3(0.3f, 1.0f, 0.5f)))};
    FrameRequest request = stereo_request(head);
    request.forecast = Forecast{head, 4};
    const Rendered picture = render_in(*view, request), expected = render_in(*exact, request);
    EXPECT_EQ(picture.stats.kind, FrameKind::key);
    EXPECT_GE(psnr_db(picture.rgb, expected.rgb), 45.0) << step;
    drawn = picture.stats.visible;
    all = expected.stats.visible;
  }
  EXPECT_LT(drawn, all / 2) << "the wall hides what is behind it";
}

/// A square that reaches beyond the inner edge of one eye's picture, `side` of the head: 1 for the
/// left eye. The other eye looks away.
void expect_no_leak(float side) {
  GaussianCloud cloud;
  add_opaque(cloud, {side * 1.2f, 0.0f, 2.0f}, {0.3f, 0.3f, 0.01f}, glm::vec3(2.0f));
  const auto renderer = core_renderer_of(std::make_shared<const GaussianCloud>(std::move(cloud)));
  const std::size_t seeing = side > 0.0f ? 0 : 1;
  Stereo eyes{Eye{{-0.05f, 0.0f}, {1.0f, -1.0f}, {3.0f, 1.0f}},
              Eye{{0.05f, 0.0f}, {-3.0f, -1.0f}, {-1.0f, 1.0f}}};
  eyes[seeing].low.x = side > 0.0f ? -1.0f : -0.6f;
  eyes[seeing].high.x = side > 0.0f ? 0.6f : 1.0f;
  const FrameRequest request = stereo_request({}, {2 * 70, 64}, eyes);
  for (const Bound& bound : bounds) {
    SCOPED_TRACE(static_cast<int>(bound.pipeline));
    const auto view = renderer->make_view({.pipeline = bound.pipeline});
    const std::vector<float> rgb = render_in(*view, request).rgb;
    const auto seen = half_of(rgb, request.camera.size_px, seeing);
    const auto other = half_of(rgb, request.camera.size_px, 1 - seeing);
    EXPECT_GT(*std::ranges::max_element(seen), 0.8f);
    for (std::size_t i = 0; i < other.size(); ++i)
      ASSERT_NEAR(other[i], request.background[static_cast<int>(i % 3)], 1e-6f) << i;
  }
}

TEST_F(StereoViews, NothingLeaksIntoTheOtherHalf) {
  expect_no_leak(1.0f);
  expect_no_leak(-1.0f);
}

TEST_F(StereoViews, TreesAndClipsServeBothEyes) {
  const TreeScenes scenes;
  const auto paged = scenes.in_pages(), whole = scenes.whole();
  FrameRequest request = stereo_request(look_at({0, 0, -6}, {0, 0, 5}));
  request.waits_for_pages = true;
  for (const ClipBox& clip : {ClipBox{}, clip_plane({0.4f, 2.0f, -0.2f}, 0.3f)}) {
    request.camera.clip = clip;
    for (const float detail_px : {0.0f, 3.0f}) {
      request.detail_px = detail_px;
      for (const Pipeline pipeline : {Pipeline::exact, Pipeline::catgs}) {
        const ViewSettings settings{.pipeline = pipeline};
        const auto view = paged->make_view(settings), left = paged->make_view(settings),
                   right = paged->make_view(settings);
        // The cut of both eyes is as fine as the finer of them wants it.
        expect_halves_of(*view, *left, *right, request, detail_px == 0.0f ? 55.0 : 40.0);
        EXPECT_GE(psnr_db(render_in(*view, request).rgb,
                          render_in(*whole->make_view(settings), request).rgb),
                  detail_px == 0.0f ? 50.0 : 30.0);
      }
    }
  }
}

TEST_F(StereoViews, AViewChangesItsEyes) {
  const auto renderer = core_renderer_of(wall_before_many());
  for (const Bound& bound : bounds) {
    SCOPED_TRACE(static_cast<int>(bound.pipeline));
    ViewSettings settings = catgs_settings;
    settings.pipeline = bound.pipeline;
    const auto view = renderer->make_view(settings), exact = renderer->make_view({});
    FrameRequest mono = request_at({}, {160, 192}), both = stereo_request({});
    mono.background = both.background;
    mono.forecast = both.forecast = Forecast{Pose{}, 4};
    Pose step;
    for (const FrameRequest* request : {&mono, &both, &both, &mono, &mono, &both, &mono}) {
      FrameRequest now = *request;
      now.camera.world_from_camera = step;
      EXPECT_GE(psnr_db(render_in(*view, now).rgb, render_in(*exact, now).rgb), 45.0);
      step.position.x += 0.01f;
    }
  }
}

TEST_F(StereoViews, DepthsLieSideBySide) {
  const auto renderer = core_renderer_of(wall_before_many());
  const auto view = renderer->make_view(catgs_settings),
             alone = renderer->make_view(catgs_settings);
  FrameRequest request =
      stereo_request({{0, 0, 0}, glm::angleAxis(0.4f, glm::vec3(0, 1, 0))}, {2 * 83, 91});
  request.depth_cells = {2 * 8, 9};
  FrameView frame;
  ASSERT_TRUE(view->render(request, frame).ok());
  ASSERT_EQ(frame.depths.cells, request.depth_cells);
  const std::vector<float> grid(frame.depths.inverse_depths.begin(),
                                frame.depths.inverse_depths.end());
  for (std::size_t eye = 0; eye < 2; ++eye) {
    FrameView own;
    ASSERT_TRUE(alone->render(request_of_eye(request, eye), own).ok());
    ASSERT_EQ(own.depths.cells, glm::ivec2(8, 9));
    for (std::size_t row = 0; row < 9; ++row)
      for (std::size_t column = 0; column < 8; ++column)
        EXPECT_NEAR(grid[row * 16 + eye * 8 + column], own.depths.inverse_depths[row * 8 + column],
                    1e-3f);
  }
  EXPECT_GT(std::abs(grid[4 * 16] - grid[4 * 16 + 7]), 0.02f) << "the wall is seen at an angle";
}

TEST_F(StereoViews, EncodersGetBothHalves) {
  const auto renderer = core_renderer_of(wall_before_many());
  const ViewSettings settings{.format = PixelFormat::i420};
  const auto view = renderer->make_view(settings), alone = renderer->make_view(settings);
  const FrameRequest request = stereo_request({}, {2 * 74, 50});
  FrameView frame;
  ASSERT_TRUE(view->render(request, frame).ok());
  EXPECT_EQ(frame.size_px, request.camera.size_px);
  for (std::size_t eye = 0; eye < 2; ++eye) {
    FrameView own;
    ASSERT_TRUE(alone->render(request_of_eye(request, eye), own).ok());
    for (std::size_t plane = 0; plane < 3; ++plane) {
      const int shrink = plane == 0 ? 1 : 2;
      const glm::ivec2 size = own.size_px / shrink;
      for (int y = 0; y < size.y; ++y) {
        const auto row_of = [&](const FrameView& of) {
          return of.planes[plane].data +
                 static_cast<std::size_t>(y) * of.planes[plane].stride_bytes;
        };
        const std::byte* const half = row_of(frame) + static_cast<int>(eye) * size.x;
        for (int x = 0; x < size.x; ++x)
          ASSERT_NEAR(static_cast<int>(half[x]), static_cast<int>(row_of(own)[x]), 1)
              << eye << " " << plane << " " << x << "," << y;
      }
    }
  }
}

TEST_F(StereoViews, BadEyesAreRefused) {
  const auto renderer =
      core_renderer_of(std::make_shared<const GaussianCloud>(random_cloud(10, 0, 1)));
  const auto view = renderer->make_view({}),
             encoded = renderer->make_view({.format = PixelFormat::i420});
  const float nan = std::nanf(""), infinite = std::numeric_limits<float>::infinity();
  struct Bad {
    const char* said;
    std::function<void(FrameRequest&)> change;
  };
  const std::vector<Bad> all{
      {"even width", [](FrameRequest& r) { r.camera.size_px.x = 321; }},
      {"orthographic", [](FrameRequest& r) { r.camera.orthographic = true; }},
      {"no parts",
       [](FrameRequest& r) {
         r.camera.crop.whole_px = {640, 192};
       }},
      {"even columns",
       [](FrameRequest& r) {
         r.depth_cells = {9, 5};
       }},
      {"left eye", [&](FrameRequest& r) { (*r.stereo)[0].offset.x = nan; }},
      {"left eye", [&](FrameRequest& r) { (*r.stereo)[0].low.x = 0.6f; }},
      {"right eye", [&](FrameRequest& r) { (*r.stereo)[1].high.y = 10.1f; }},
      {"right eye", [&](FrameRequest& r) { (*r.stereo)[1].low.y = -infinite; }},
      {"right eye", [](FrameRequest& r) { std::swap((*r.stereo)[1].low, (*r.stereo)[1].high); }}};
  for (const Bad& bad : all) {
    FrameRequest request = stereo_request({});
    bad.change(request);
    FrameView frame;
    const RenderStatus status = view->render(request, frame);
    EXPECT_EQ(status.code, RenderStatus::Code::invalid_request) << bad.said;
    EXPECT_NE(status.message.find(bad.said), std::string::npos) << status.message;
  }
  FrameView frame;
  const FrameRequest odd_halves = stereo_request({}, {2 * 75, 50});
  EXPECT_TRUE(view->render(odd_halves, frame).ok());
  EXPECT_EQ(encoded->render(odd_halves, frame).code, RenderStatus::Code::invalid_request);
}

}  // namespace
}  // namespace catgs::test

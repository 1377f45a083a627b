// Pipeline::catgs in the CPU core against its exact pipeline at the same poses.

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <limits>
#include <string>

#include <gtest/gtest.h>

#include "render_core/base/thread_pool.h"
#include "render_core/metrics/image_quality.h"
#include "render_core/motion/anchor.h"
#include "render_core/motion/script.h"
#include "render_core/motion/trajectory.h"
#include "render_core/renderer.h"
#include "render_core/synth/synth.h"
#include "tests/support/camera_moves.h"
#include "tests/support/rendered.h"
#include "tests/support/test_scenes.h"

namespace catgs {
namespace {

using test::render_in;
using test::Rendered;

std::unique_ptr<Renderer> renderer_of(std::shared_ptr<const GaussianCloud> cloud, int threads = 2,
                                      const std::string& simd = "auto") {
  return make_renderer(std::move(cloud),
                       {RendererKind::cpu, std::make_shared<ThreadPool>(threads), simd})
      .renderer;
}

const ViewSettings catgs_settings{.pipeline = Pipeline::catgs};

/// A closed wall 4 units away, and 30,000 Gaussians behind it from 6 units on.
std::shared_ptr<const GaussianCloud> wall_before_many() {
  GaussianCloud cloud = test::random_cloud(30'000, 0, 11);
  const std::size_t behind = cloud.size(), side = 40;
  for (glm::vec3& mean : cloud.mean) mean.z = 6.0f + std::abs(mean.z);
  cloud.resize(behind + 2 * side * side, 0);
  for (std::size_t i = 0; i < 2 * side * side; ++i) {
    const std::size_t k = i % (side * side), at = behind + i;
    cloud.mean[at] = {0.2f * (static_cast<float>(k % side) - 20.0f),
                      0.2f * (static_cast<float>(k / side) - 20.0f), i < side * side ? 4.0f : 4.1f};
    cloud.scale[at] = glm::vec3(0.2f, 0.2f, 0.01f);
    cloud.rotation[at] = glm::quat(1.0f, 0.0f, 0.0f, 0.0f);
    cloud.opacity[at] = 0.99f;
    cloud.sh[at] = glm::vec3(k % 7 == 0 ? 1.0f : -0.5f);
  }
  return std::make_shared<const GaussianCloud>(std::move(cloud));
}

FrameRequest request_at(const Pose& pose, glm::ivec2 size_px = {320, 192}) {
  FrameRequest request;
  request.camera = make_camera(pose, size_px, 300.0f);
  return request;
}

/// The quality of catgs along a path.
struct PathQuality {
  double squares = 0.0;
  double worst_frame = std::numeric_limits<double>::infinity();
  double worst_block = std::numeric_limits<double>::infinity();
  int frames = 0;
  std::int64_t left_out = 0;  // list entries of exact that catgs did not have

  void follow(Renderer& renderer, const Trajectory& path) {
    const auto view = renderer.make_view(catgs_settings), exact = renderer.make_view({});
    for (const TimedPose& sample : path) {
      FrameRequest request;
      request.camera = make_camera(sample.world_from_camera, {320, 192}, 183.0f);
      const Rendered drawn = render_in(*view, request), expected = render_in(*exact, request);
      const ImageQuality quality = compare_images(Image{request.camera.size_px, drawn.rgb},
                                                  Image{request.camera.size_px, expected.rgb});
      left_out += static_cast<std::int64_t>(expected.stats.list_entries) -
                  static_cast<std::int64_t>(drawn.stats.list_entries);
      squares += std::pow(10.0, -0.1 * quality.psnr());
      worst_frame = std::min(worst_frame, quality.psnr());
      worst_block = std::min(worst_block, quality.worst_block_psnr());
      ++frames;
    }
  }
  [[nodiscard]] double mean() const { return -10.0 * std::log10(squares / frames); }

  void expect_good() const {
    EXPECT_GE(mean(), 50.0);
    EXPECT_GE(worst_frame, 40.0);
    EXPECT_GE(worst_block, 30.0);
    EXPECT_GT(left_out, 0);
  }
};

class CatgsInTheCity : public testing::Test {
 protected:
  ThreadPool pool_{2};
  Scene scene_ = synthesize(SynthKind::city, 20'000, 1, pool_);
  std::unique_ptr<Renderer> renderer_ =
      renderer_of(std::make_shared<const GaussianCloud>(scene_.cloud));
};

TEST_F(CatgsInTheCity, KeepsItsQualityOnScriptedMotion) {
  for (const std::string script : {"walk", "head", "drone", "orbit"}) {
    for (const double rate_hz : {30.0, 120.0}) {
      SCOPED_TRACE(testing::Message() << script << " at " << rate_hz << " Hz");
      PathQuality quality;
      quality.follow(
          *renderer_,
          resample(make_script({.script = script, .duration_s = 0.6}, scene_.hints), rate_hz));
      quality.expect_good();
    }
  }
}

TEST_F(CatgsInTheCity, KeepsItsQualityOnRecordedHeads) {
  const char* shared = std::getenv("CATGS_SHARED_DIR");
  const auto folder =
      (shared != nullptr ? std::filesystem::path(shared)
                         : std::filesystem::path(CATGS_SOURCE_DIR).parent_path() / "shared") /
      "traces/head";
  if (!std::filesystem::is_directory(folder)) GTEST_SKIP() << "no folder " << folder;
  int traces = 0;
  for (const auto& file : std::filesystem::directory_iterator(folder)) {
    if (file.path().extension() != ".tum") continue;
    SCOPED_TRACE(file.path().filename().string());
    const Trajectory path = resample(anchored(read_tum(file.path()), scene_.hints), 60.0);
    // A part with much motion in it; all of it would take minutes.
    const auto first = static_cast<std::ptrdiff_t>(std::min<std::size_t>(300, path.size() / 2));
    const auto last = std::min<std::ptrdiff_t>(first + 40, std::ssize(path));
    PathQuality quality;
    quality.follow(*renderer_, Trajectory(path.begin() + first, path.begin() + last));
    quality.expect_good();
    ++traces;
  }
  EXPECT_GT(traces, 0);
}

TEST(CatgsView, DoesNotDrawWhatAWallHides) {
  const auto renderer = renderer_of(wall_before_many());
  const auto view = renderer->make_view(catgs_settings), exact = renderer->make_view({});
  const FrameRequest request = request_at({});
  const Rendered expected = render_in(*exact, request);
  EXPECT_EQ(render_in(*view, request).stats.visible, expected.stats.visible) << "nothing is known";
  for (int frame = 0; frame < 3; ++frame) {
    const Rendered drawn = render_in(*view, request);
    EXPECT_LT(2 * drawn.stats.visible, expected.stats.visible);
    EXPECT_LT(2 * drawn.stats.list_entries, expected.stats.list_entries);
    EXPECT_GE(test::psnr_db(drawn.rgb, expected.rgb), 45.0);
  }
}

TEST(CatgsView, ALeapOfTheCameraHidesNothing) {
  const auto renderer = renderer_of(wall_before_many());
  const auto view = renderer->make_view(catgs_settings), exact = renderer->make_view({});
  // Beyond the wall, to the side, and the other way round.
  const Pose leaps[] = {
      {{0, 0, 5}, {1, 0, 0, 0}}, {{30, 0, 0}, {1, 0, 0, 0}}, {{0, 0, 40}, {0, 0, 1, 0}}};
  for (const Pose& leap : leaps) {
    for (int frame = 0; frame < 2; ++frame) render_in(*view, request_at({}));
    const Rendered drawn = render_in(*view, request_at(leap));
    const Rendered expected = render_in(*exact, request_at(leap));
    EXPECT_EQ(drawn.stats.visible, expected.stats.visible);
    EXPECT_GE(test::psnr_db(drawn.rgb, expected.rgb), 45.0);
  }
}

// A camera goes along a plate and looks past its edge. Behind it is a pattern that a frame without
// it would lack.
TEST(CatgsView, DrawsWhatComesOutBehindAnEdge) {
  GaussianCloud cloud;
  const auto add = [&](glm::vec3 mean, glm::vec3 scale, glm::vec3 sh) {
    cloud.resize(cloud.size() + 1, 0);
    cloud.mean.back() = mean;
    cloud.scale.back() = scale;
    cloud.rotation.back() = glm::quat(1.0f, 0.0f, 0.0f, 0.0f);
    cloud.opacity.back() = 0.99f;
    cloud.sh.back() = sh;
  };
  for (int copy = 0; copy < 2; ++copy) {
    for (int y = -20; y <= 20; ++y) {
      for (int x = -40; x <= 40; ++x) {
        const glm::vec2 at(x, y);
        const glm::vec3 pattern((x + y) % 2 == 0 ? 1.5f : -1.5f);
        add({0.3f * at, 10.0f}, {0.2f, 0.2f, 0.01f}, pattern);
        if (x <= 0) add({0.1f * at, 3.0f}, {0.07f, 0.07f, 0.01f}, glm::vec3(-0.5f));
      }
    }
  }
  const auto renderer = renderer_of(std::make_shared<const GaussianCloud>(std::move(cloud)));
  for (const float step : {0.005f, 0.02f, 0.05f, -0.02f}) {
    SCOPED_TRACE(step);
    const auto view = renderer->make_view(catgs_settings), exact = renderer->make_view({});
    std::uint32_t hidden = 0;
    for (int k = 0; k < 20; ++k) {
      const FrameRequest request = request_at({{step * static_cast<float>(k), 0, 0}, {1, 0, 0, 0}});
      const Rendered drawn = render_in(*view, request), expected = render_in(*exact, request);
      hidden += expected.stats.visible - drawn.stats.visible;
      const ImageQuality quality = compare_images({request.camera.size_px, drawn.rgb},
                                                  {request.camera.size_px, expected.rgb});
      EXPECT_GE(quality.psnr(), 45.0) << k;
      EXPECT_GE(quality.worst_block_psnr(), 30.0) << k;
    }
    EXPECT_GT(hidden, 0u);
  }
}

TEST(CatgsView, ANewImageSizeHidesNothing) {
  const auto renderer = renderer_of(wall_before_many());
  const auto view = renderer->make_view(catgs_settings), exact = renderer->make_view({});
  for (const glm::ivec2 size : {glm::ivec2(200, 150), glm::ivec2(17, 300), glm::ivec2(64, 64)}) {
    const FrameRequest request = request_at({}, size);
    const Rendered first = render_in(*view, request), second = render_in(*view, request);
    const Rendered expected = render_in(*exact, request);
    EXPECT_EQ(first.stats.visible, expected.stats.visible);
    EXPECT_LT(second.stats.visible, expected.stats.visible);
    EXPECT_GE(test::psnr_db(second.rgb, expected.rgb), 45.0);
  }
}

TEST(CatgsView, DrawsTheSmallestPictures) {
  const auto renderer = renderer_of(wall_before_many());
  const auto view = renderer->make_view(catgs_settings), exact = renderer->make_view({});
  for (const glm::ivec2 size : {glm::ivec2(1, 1), glm::ivec2(4, 4), glm::ivec2(5, 3)}) {
    const FrameRequest request = request_at({}, size);
    for (int frame = 0; frame < 3; ++frame)
      EXPECT_GE(test::psnr_db(render_in(*view, request).rgb, render_in(*exact, request).rgb), 40.0);
  }
}

TEST(CatgsView, EachInstructionSetAndAnyNumberOfThreadsDrawTheSame) {
  const auto cloud = wall_before_many();
  const test::Move move = test::moves().back();
  const auto pictures = [&](int threads, const std::string& simd) {
    const auto renderer = renderer_of(cloud, threads, simd);
    const auto view = renderer->make_view(catgs_settings);
    std::vector<Rendered> all;
    Pose pose;
    for (int k = 0; k < 4; ++k) {
      all.push_back(render_in(*view, request_at(pose)));
      pose = test::moved(pose, {"", 0.2f * move.shift, 0.2f * move.turn_rad});
    }
    return all;
  };
  const std::vector<Rendered> expected = pictures(1, "auto");
  const std::vector<Rendered> threaded = pictures(5, "auto");
  for (std::size_t k = 0; k < expected.size(); ++k)
    EXPECT_EQ(threaded[k].rgb, expected[k].rgb) << k;
  for (const std::string_view simd : simd_targets()) {
    const std::vector<Rendered> other = pictures(2, std::string(simd));
    for (std::size_t k = 0; k < expected.size(); ++k)
      EXPECT_GE(test::psnr_db(other[k].rgb, expected[k].rgb), 60.0) << simd << " " << k;
  }
}

TEST(CatgsView, ARefusedFrameChangesNothing) {
  const auto renderer = renderer_of(wall_before_many());
  const auto view = renderer->make_view(catgs_settings);
  render_in(*view, request_at({}));
  const Rendered before = render_in(*view, request_at({}));
  FrameRequest bad = request_at({});
  bad.camera.focal_px.x = -1.0f;
  FrameView frame;
  EXPECT_FALSE(view->render(bad, frame).ok());
  EXPECT_EQ(render_in(*view, request_at({})).rgb, before.rgb);
}

// Strong harmonics, seen by a camera that turns, steps aside and comes back: colours are kept, but
// none for too long. The two Views differ in nothing else.
TEST(CatgsView, ColoursAreKeptWhileTheirDirectionHolds) {
  const test::TestScene scene = test::small_scenes().front();
  const auto renderer = renderer_of(scene.cloud);
  ViewSettings settings = catgs_settings;
  const auto keeping = renderer->make_view(settings);
  settings.colour_cache = false;
  const auto shading = renderer->make_view(settings);
  FrameRequest request = scene.request;
  Pose& pose = request.camera.world_from_camera;
  const auto psnr = [&] {
    return test::psnr_db(render_in(*keeping, request).rgb, render_in(*shading, request).rgb);
  };
  EXPECT_GE(psnr(), 100.0);
  pose.orientation = glm::quat(glm::vec3(0.1f, -0.2f, 0.3f)) * pose.orientation;
  EXPECT_GE(psnr(), 100.0) << "turning changes no colour";
  int kept = 0;
  for (int step = 0; step < 30; ++step) {
    pose.position.x += step < 20 ? 0.004f : -0.006f;
    const double db = psnr();
    EXPECT_GE(db, 60.0) << "step " << step;
    kept += db < 100.0;
  }
  EXPECT_GT(kept, 0);
}

}  // namespace
}  // namespace catgs

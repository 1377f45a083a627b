// Whole images of the CPU core against the reference.

#include <cstdlib>
#include <limits>
#include <numeric>
#include <ranges>
#include <thread>

#include <gtest/gtest.h>

#include "render_core/base/error.h"
#include "render_core/base/thread_pool.h"
#include "render_core/cpu/kernels.h"
#include "render_core/cuda/cuda_renderer.h"
#include "render_core/frame/renderer.h"
#include "tests/support/picked.h"
#include "tests/support/refusal.h"
#include "tests/support/rendered.h"
#include "tests/support/test_scenes.h"

namespace catgs {
namespace {

using test::TestScene;

std::shared_ptr<ThreadPool> pool_of(int threads) { return std::make_shared<ThreadPool>(threads); }

test::Rendered render(const TestScene& scene, const RendererOptions& options,
                      const ViewSettings& settings = {}) {
  const auto renderer = make_renderer(scene.cloud, options).renderer;
  return test::render_in(*renderer->make_view(settings), scene.request);
}

class SmallScenes : public testing::TestWithParam<TestScene> {};

TEST_P(SmallScenes, ExactMatchesReference) {
  const auto reference = render(GetParam(), {RendererKind::reference, pool_of(2), "auto"});
  for (const std::string_view simd : std::views::transform(simd_kernels(), &SimdKernels::name)) {
    const auto exact = render(GetParam(), {RendererKind::cpu, pool_of(2), std::string(simd)});
    EXPECT_GE(test::psnr_db(exact.rgb, reference.rgb), 60.0) << simd;
    EXPECT_EQ(exact.stats.overflowed_entries, 0u);
    RecordProperty("psnr_" + std::string(simd),
                   std::to_string(test::psnr_db(exact.rgb, reference.rgb)));
  }
}

// A level floor from straight above: all of it has one depth.
TEST(EqualDepths, AreBlendedAlikeWhateverTheOrderOfTheFile) {
  TestScene scene = test::small_scenes().front();
  scene.request.camera.world_from_camera = {};
  GaussianCloud cloud = *scene.cloud;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    cloud.mean[i].z = 4.0f;
    cloud.opacity[i] = 0.9f;
  }
  std::vector<std::uint32_t> backwards(cloud.size());
  std::iota(backwards.rbegin(), backwards.rend(), 0u);
  for (const RendererKind kind : {RendererKind::cpu, RendererKind::reference}) {
    std::vector<std::vector<float>> pictures;
    for (const GaussianCloud& of : {cloud, test::picked(cloud, backwards)}) {
      scene.cloud = std::make_shared<const GaussianCloud>(of);
      pictures.push_back(render(scene, {kind, pool_of(2), "auto"}).rgb);
    }
    EXPECT_EQ(pictures[0], pictures[1]);
  }
}

/// Means of `factor` x `factor` pixels.
std::vector<float> reduced(const std::vector<float>& rgb, glm::ivec2 size_px, int factor) {
  std::vector<float> means(rgb.size() / static_cast<std::size_t>(factor * factor));
  for (int y = 0; y < size_px.y; ++y)
    for (int x = 0; x < size_px.x; ++x)
      for (int c = 0; c < 3; ++c)
        means[static_cast<std::size_t>((y / factor * (size_px.x / factor) + x / factor) * 3 + c)] +=
            rgb[static_cast<std::size_t>((y * size_px.x + x) * 3 + c)] /
            static_cast<float>(factor * factor);
  return means;
}

// Gaussians much smaller than a pixel. A picture with many samples a pixel is the truth, and there
// the low-pass filter changes little.
TEST(Antialiasing, PicturesOfSmallGaussiansAreThoseOfManySamples) {
  constexpr int factor = 8;
  TestScene scene;
  GaussianCloud cloud = test::random_cloud(3000, 0, 17);
  for (glm::vec3& scale : cloud.scale) scale = glm::vec3(0.01f);
  scene.request.camera = make_camera({}, {64, 48}, 40.0f);
  const auto picture = [&](SplatModel model, int samples) {
    cloud.model = model;
    scene.cloud = std::make_shared<const GaussianCloud>(cloud);
    scene.request.camera =
        make_camera({}, glm::ivec2(64, 48) * samples, 40.0f * static_cast<float>(samples));
    return render(scene, {RendererKind::cpu, pool_of(2), "auto"}).rgb;
  };
  const std::vector<float> truth =
      reduced(picture(SplatModel::antialiased, factor), glm::ivec2(64, 48) * factor, factor);
  const double antialiased = test::psnr_db(picture(SplatModel::antialiased, 1), truth);
  const double standard = test::psnr_db(picture(SplatModel::standard, 1), truth);
  EXPECT_GE(antialiased, 30.0);
  EXPECT_GE(antialiased, standard + 6.0);
}

TEST_P(SmallScenes, VanillaMatchesExact) {
  const auto exact = render(GetParam(), {RendererKind::cpu, pool_of(2), "auto"});
  const auto vanilla =
      render(GetParam(), {RendererKind::cpu, pool_of(2), "auto"}, {.pipeline = Pipeline::vanilla});
  EXPECT_GE(test::psnr_db(vanilla.rgb, exact.rgb), 55.0);
  RecordProperty("psnr", std::to_string(test::psnr_db(vanilla.rgb, exact.rgb)));
}

TEST_P(SmallScenes, ThreadsDoNotChangeTheImage) {
  for (const Pipeline pipeline : {Pipeline::exact, Pipeline::vanilla}) {
    const ViewSettings settings{.pipeline = pipeline};
    const auto one = render(GetParam(), {RendererKind::cpu, pool_of(1), "auto"}, settings);
    const auto many = render(GetParam(), {RendererKind::cpu, pool_of(5), "auto"}, settings);
    EXPECT_EQ(one.rgb, many.rgb);
    EXPECT_EQ(one.stats.list_entries, many.stats.list_entries);
  }
}

INSTANTIATE_TEST_SUITE_P(, SmallScenes, testing::ValuesIn(test::small_scenes()),
                         [](const auto& test) { return test.param.name; });

std::vector<std::uint8_t> copy_bytes(const FrameView& frame) {
  std::vector<std::uint8_t> bytes;
  for (int plane = 0; plane < 3; ++plane) {
    const glm::ivec2 size = plane == 0 ? frame.size_px : frame.size_px / 2;
    for (int y = 0; y < size.y; ++y) {
      const auto* row = reinterpret_cast<const std::uint8_t*>(frame.planes[plane].data) +
                        frame.planes[plane].stride_bytes * y;
      bytes.insert(bytes.end(), row, row + size.x);
    }
  }
  return bytes;
}

TEST(I420, BackgroundPatchesHaveTheCodesOfBt709) {
  struct Patch {
    glm::vec3 rgb;
    int y, cb, cr;
  };
  // Bars of 100 % and 75 % and a grey, by the formulas of ITU-R BT.709-6 in rational arithmetic.
  const Patch patches[] = {
      {{1, 1, 1}, 235, 128, 128},          {{0, 0, 0}, 16, 128, 128},
      {{1, 0, 0}, 63, 102, 240},           {{0, 1, 0}, 173, 42, 26},
      {{0, 0, 1}, 32, 240, 118},           {{1, 1, 0}, 219, 16, 138},
      {{0, 1, 1}, 188, 154, 16},           {{1, 0, 1}, 78, 214, 230},
      {{0.5f, 0.5f, 0.5f}, 126, 128, 128}, {{0.75f, 0, 0.75f}, 63, 193, 204},
  };
  for (const std::string_view simd : std::views::transform(simd_kernels(), &SimdKernels::name)) {
    const auto renderer = make_renderer(std::make_shared<const GaussianCloud>(),
                                        {RendererKind::cpu, pool_of(2), std::string(simd)})
                              .renderer;
    const auto view = renderer->make_view({.format = PixelFormat::i420});
    for (const Patch& patch : patches) {
      FrameView frame;
      ASSERT_TRUE(view->render({make_camera({}, {38, 22}, 30.0f), patch.rgb}, frame).ok());
      const auto bytes = copy_bytes(frame);
      const std::size_t luma = 38 * 22;
      ASSERT_EQ(bytes.size(), luma * 3 / 2);
      for (std::size_t i = 0; i < bytes.size(); ++i) {
        const int expected = i < luma ? patch.y : i < luma * 5 / 4 ? patch.cb : patch.cr;
        ASSERT_EQ(bytes[i], expected) << simd << " byte " << i;
      }
    }
  }
}

TEST(I420, MatchesReferenceWithinOneCode) {
  for (const TestScene& scene : test::small_scenes()) {
    const glm::ivec2 size = scene.request.camera.size_px;
    if (size.x % 2 != 0 || size.y % 2 != 0) continue;
    std::vector<std::vector<std::uint8_t>> images;
    std::vector<RendererOptions> cores = {{RendererKind::reference, pool_of(2), "auto"}};
    for (const std::string_view simd : std::views::transform(simd_kernels(), &SimdKernels::name))
      cores.push_back({RendererKind::cpu, pool_of(2), std::string(simd)});
    for (const RendererOptions& core : cores) {
      const auto renderer = make_renderer(scene.cloud, core).renderer;
      const auto view = renderer->make_view({.format = PixelFormat::i420});
      FrameView frame;
      ASSERT_TRUE(view->render(scene.request, frame).ok());
      images.push_back(copy_bytes(frame));
    }
    for (const auto& image : images)
      for (std::size_t i = 0; i < image.size(); ++i)
        ASSERT_LE(std::abs(image[i] - images.front()[i]), 1) << scene.name << " byte " << i;
  }
}

TEST(CpuView, ViewsRenderAtTheSameTime) {
  const TestScene scene = test::small_scenes().front();
  const auto renderer =
      make_renderer(scene.cloud, {RendererKind::cpu, pool_of(2), "auto"}).renderer;
  const auto expected = render(scene, {RendererKind::cpu, pool_of(1), "auto"}).rgb;
  const auto loop = [&] {
    const auto view = renderer->make_view({});
    for (int i = 0; i < 20; ++i) {
      FrameView frame;
      ASSERT_TRUE(view->render(scene.request, frame).ok());
      ASSERT_EQ(test::copy_rgb(frame), expected);
    }
  };
  const std::jthread other(loop);
  loop();
}

TEST(CpuView, FramesDoNotDependOnTheOnesBefore) {
  const std::vector<TestScene> scenes = test::small_scenes();
  const auto renderer =
      make_renderer(scenes.front().cloud, {RendererKind::cpu, pool_of(2), "auto"}).renderer;
  const auto view = renderer->make_view({});
  for (const glm::ivec2 size : {glm::ivec2(200, 150), glm::ivec2(17, 300), glm::ivec2(64, 64)}) {
    TestScene scene = scenes.front();
    scene.request.camera = make_camera(scene.request.camera.world_from_camera, size, 140.0f);
    FrameView frame;
    ASSERT_TRUE(view->render(scene.request, frame).ok());
    EXPECT_EQ(frame.size_px, size);
    EXPECT_EQ(test::copy_rgb(frame), render(scene, {RendererKind::cpu, pool_of(2), "auto"}).rgb);
  }
}

TEST(CpuView, CountsThePairsOfTheReference) {
  for (const TestScene& scene : test::small_scenes()) {
    const auto reference = render(scene, {RendererKind::reference, pool_of(2), "auto"});
    for (const std::string_view simd : std::views::transform(simd_kernels(), &SimdKernels::name)) {
      const auto exact =
          render(scene, {RendererKind::cpu, pool_of(2), std::string(simd)}, {.count_pairs = true});
      // The reference counts what it blends or skips in front of saturation; rounding moves rims.
      const auto expected = static_cast<double>(reference.stats.blended_pairs);
      EXPECT_NEAR(static_cast<double>(exact.stats.blended_pairs), expected, 2.0 + 1e-3 * expected);
    }
  }
}

TEST(CpuView, ListMemoryIsBounded) {
  EXPECT_EQ(ViewSettings{}.max_list_entries, 67'108'864u);
  const TestScene scene = test::small_scenes().front();
  for (const Pipeline pipeline : {Pipeline::exact, Pipeline::vanilla}) {
    const ViewSettings settings{.pipeline = pipeline, .max_list_entries = 1000};
    const auto bounded = render(scene, {RendererKind::cpu, pool_of(1), "auto"}, settings);
    EXPECT_LE(bounded.stats.list_entries, 1000u);
    EXPECT_GT(bounded.stats.overflowed_entries, 0u);
    const auto many = render(scene, {RendererKind::cpu, pool_of(5), "auto"}, settings);
    EXPECT_EQ(bounded.rgb, many.rgb);
  }
}

TEST(CpuView, RefusesImpossibleRequests) {
  const TestScene scene = test::small_scenes().front();
  const auto renderer =
      make_renderer(scene.cloud, {RendererKind::cpu, pool_of(1), "auto"}).renderer;
  const auto rgb = renderer->make_view({});
  const auto i420 = renderer->make_view({.format = PixelFormat::i420});
  const auto expect_refusal = [&](View& view, const auto& change) {
    FrameRequest request = scene.request;
    change(request);
    FrameView frame;
    const RenderStatus status = view.render(request, frame);
    EXPECT_EQ(status.code, RenderStatus::Code::invalid_request);
    EXPECT_EQ(frame.planes[0].data, nullptr);
    return status.message;
  };
  constexpr float nan = std::numeric_limits<float>::quiet_NaN();
  using Change = void (*)(FrameRequest&);
  for (const Change change : std::vector<Change>{
           [](auto& r) { r.camera.size_px = glm::ivec2(0, 5); },
           [](auto& r) { r.camera.size_px = glm::ivec2(8193, 5); },
           [](auto& r) { r.camera.focal_px = glm::vec2(0, 5); },
           [](auto& r) { r.camera.focal_px = glm::vec2(nan, 5); },
           [](auto& r) { r.camera.near_z = 0; },
           [](auto& r) { r.camera.principal_point_px.x = nan; },
           [](auto& r) {
             r.camera.crop = Crop{glm::ivec2(1, 0), r.camera.size_px};
           },
           [](auto& r) { r.camera.world_from_camera.position.y = nan; },
           [](auto& r) { r.camera.world_from_camera.orientation = glm::quat(0, 0, 0, 0); },
           [](auto& r) { r.background.x = nan; },
       })
    expect_refusal(*rgb, change);
  const auto odd = [](FrameRequest& r) { r.camera.size_px = glm::ivec2(33, 20); };
  EXPECT_EQ(expect_refusal(*i420, odd), "request: i420 needs even sides, not 33x20");
}

TEST(MakeRenderer, SaysWhatItChoseAndWhy) {
  const auto cloud = std::make_shared<const GaussianCloud>(test::random_cloud(10, 0, 1));
  EXPECT_FALSE(make_renderer(cloud, {RendererKind::automatic, pool_of(2), "auto"}).reason.empty());
  const MadeRenderer made = make_renderer(cloud, {RendererKind::cpu, pool_of(2), "auto"});
  EXPECT_EQ(made.renderer->description(),
            "CPU, " + std::string(simd_kernels().front().name) + ", 2 threads");
  EXPECT_FALSE(made.reason.empty());
  EXPECT_GT(made.renderer->scene_bytes(), 0u);

  const MadeRenderer scalar = make_renderer(cloud, {RendererKind::cpu, pool_of(1), "scalar"});
  EXPECT_EQ(scalar.renderer->description(), "CPU, SCALAR, 1 thread");
}

TEST(MakeRenderer, RefusesWhatThisMachineLacks) {
  const auto cloud = std::make_shared<const GaussianCloud>();
  if (!cuda_obstacle().empty()) {
    EXPECT_THROW(make_renderer(cloud, {RendererKind::cuda, pool_of(1), "auto"}), InputError);
  }
  EXPECT_EQ(test::refusal_of([&] {
              make_renderer(cloud, {RendererKind::cpu, pool_of(1), "mmx"});
            }).source,
            "--simd");
}

}  // namespace
}  // namespace catgs

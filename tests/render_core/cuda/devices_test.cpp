// Many Views over one scene, on one CUDA device and on several; needs a device, better two.
#include <memory>
#include <thread>
#include <vector>

#include <cuda_runtime_api.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "render_core/base/device_set.h"
#include "tests/render_core/cuda/device.h"
#include "tests/support/camera_moves.h"
#include "tests/support/refusal.h"

namespace catgs {
namespace {

using test::render_in;
using test::Rendered;
using test::TestScene;
using testing::Each;
using testing::ElementsAre;
using testing::Pair;

/// Some groups of key frame and sub-frames along `move`.
std::vector<Rendered> draw_path(View& view, const TestScene& scene, const test::Move& move) {
  std::vector<Rendered> frames;
  for (int group = 0; group < 5; ++group) {
    for (int k = 0; k <= test::window; ++k)
      frames.push_back(render_in(view, test::request_on_path(scene, move, k)));
  }
  return frames;
}

class Devices : public test::CoreTest {
 protected:
  std::unique_ptr<Renderer> make(std::shared_ptr<DeviceSet> set) {
    return make_renderer(scene_.cloud, {.kind = RendererKind::cuda, .pool = {}, .devices = set})
        .renderer;
  }

  const TestScene scene_ = test::random_scene(50'000);
};

/// Every device of the machine, and a renderer on all of them.
class AllDevices : public Devices {
 protected:
  void SetUp() override {
    Devices::SetUp();
    if (IsSkipped()) return;
    renderer_ = make(set_);
    count_ = set_->views().size();
    if (count_ < 2) GTEST_SKIP() << "one CUDA device is here, this test needs two";
  }

  const std::shared_ptr<DeviceSet> set_ = std::make_shared<DeviceSet>(std::vector<int>{});
  std::unique_ptr<Renderer> renderer_;
  std::size_t count_ = 0;
};

// Sequences, not single frames: Views keep caches, and these must not mix.
TEST_F(Devices, ViewsOfOneDeviceDrawInThreadsWhatTheyDrawAlone) {
  const auto set = std::make_shared<DeviceSet>();
  const auto renderer = make(set);
  const std::vector<test::Move> moves = test::moves();
  std::vector<std::vector<Rendered>> alone;
  for (const test::Move& move : moves)
    alone.push_back(draw_path(*renderer->make_view(test::patient_settings()), scene_, move));
  std::vector<std::jthread> threads;
  for (std::size_t i = 0; i < moves.size(); ++i) {
    threads.emplace_back([&, i] {
      const auto view = renderer->make_view(test::patient_settings());
      const std::vector<Rendered> frames = draw_path(*view, scene_, moves[i]);
      for (std::size_t k = 0; k < frames.size(); ++k) {
        EXPECT_EQ(frames[k].stats.kind, alone[i][k].stats.kind) << moves[i].name << " " << k;
        EXPECT_GE(test::psnr_db(frames[k].rgb, alone[i][k].rgb), 60.0) << moves[i].name << " " << k;
      }
    });
  }
  threads.clear();
  EXPECT_THAT(set->views(), ElementsAre(Pair(0, 0)));
}

TEST_F(Devices, ViewsComeAndGoWhileAnotherRenders) {
  const auto set = std::make_shared<DeviceSet>();
  const auto renderer = make(set);
  const auto lasting = renderer->make_view({});
  const Rendered first = render_in(*lasting, scene_.request);
  {
    const std::jthread visitors([&] {
      for (int i = 0; i < 20; ++i)
        EXPECT_GE(test::psnr_db(render_in(*renderer->make_view({}), scene_.request).rgb, first.rgb),
                  60.0);
    });
    for (int i = 0; i < 100; ++i)
      EXPECT_GE(test::psnr_db(render_in(*lasting, scene_.request).rgb, first.rgb), 60.0);
  }
  EXPECT_THAT(set->views(), ElementsAre(Pair(0, 1)));
}

TEST_F(Devices, AMissingDeviceIsAMistakeForAutoToo) {
  for (const RendererKind kind : {RendererKind::cuda, RendererKind::automatic}) {
    const RendererOptions options{
        .kind = kind, .pool = {}, .devices = std::make_shared<DeviceSet>(std::vector<int>{4096})};
    EXPECT_EQ(test::refusal_of([&] { make_renderer(scene_.cloud, options); }).source,
              "--device 4096");
  }
}

TEST_F(AllDevices, ShareTheViewsAndDrawTheSame) {
  const auto one = make(std::make_shared<DeviceSet>());
  EXPECT_EQ(renderer_->scene_bytes(), one->scene_bytes());
  const Rendered alone = render_in(*one->make_view({}), scene_.request);

  std::vector<std::unique_ptr<View>> views(2 * count_);
  for (auto& view : views) view = renderer_->make_view({});
  EXPECT_THAT(set_->views(), Each(Pair(testing::_, 2)));
  std::vector<std::jthread> threads;
  for (const auto& view : views) {
    threads.emplace_back([&] {
      for (int i = 0; i < 10; ++i)
        EXPECT_GE(test::psnr_db(render_in(*view, scene_.request).rgb, alone.rgb), 60.0)
            << "device " << *view->device();
    });
  }
  threads.clear();
  views.clear();
  EXPECT_THAT(set_->views(), Each(Pair(testing::_, 0)));
}

TEST_F(AllDevices, AViewGoesWhereMemoryIs) {
  (void)cudaSetDevice(0);
  const test::Hog hog(std::size_t{2} << 20);
  for (int i = 0; i < 3; ++i) EXPECT_NE(renderer_->make_view({})->device(), 0);
}

TEST_F(AllDevices, ANewViewTakesThePlaceOfOneThatEnded) {
  std::vector<std::unique_ptr<View>> views(count_);
  for (auto& view : views) view = renderer_->make_view({});
  for (auto& view : views) {
    const auto device = view->device();
    view.reset();
    view = renderer_->make_view({});
    EXPECT_EQ(view->device(), device);
  }
}

TEST_F(AllDevices, ScenesSpreadTheirViewsTogether) {
  const auto other_scene = make(set_);
  const auto a = renderer_->make_view({}), b = other_scene->make_view({});
  EXPECT_NE(a->device(), b->device());
}

TEST_F(AllDevices, OneThatIsNotTheFirstRendersAlone) {
  const auto renderer = make(std::make_shared<DeviceSet>(std::vector<int>{1}));
  const auto view = renderer->make_view(test::patient_settings());
  EXPECT_EQ(view->device(), 1);
  const test::Move move = test::moves().front();
  const auto first = make(std::make_shared<DeviceSet>())->make_view(test::patient_settings());
  const std::vector<Rendered> a = draw_path(*view, scene_, move),
                              b = draw_path(*first, scene_, move);
  for (std::size_t k = 0; k < a.size(); ++k)
    EXPECT_GE(test::psnr_db(a[k].rgb, b[k].rgb), 60.0) << k;
}

}  // namespace
}  // namespace catgs

#include "render_core/frame/frame_driver.h"

#include <algorithm>
#include <new>
#include <optional>
#include <stdexcept>
#include <vector>

#include <gtest/gtest.h>

#include "render_core/frame/device_error.h"

namespace catgs {
namespace {

/// A core that draws nothing and notes what it is asked for.
class Core {
 public:
  explicit Core(const ViewSettings& settings,
                FrameDriver::CatgsWindows windows = FrameDriver::CatgsWindows::none)
      : driver_(settings, windows) {}

  RenderStatus render(const FrameRequest& request) {
    return driver_.render(
        request, frame,
        [&](const FramePlan& plan) -> std::optional<FrameView> {
          asked.push_back(plan);
          if (fails) fails();
          if (refuses && plan.kind == FrameKind::sub) return std::nullopt;
          FrameView drawn;
          drawn.stats = stats;
          drawn.stats.stage_ms[0] = plan.kind == FrameKind::sub ? sub_ms
                                    : plan.window > 0           ? key_ms
                                                                : plain_ms;
          return drawn;
        },
        [&] { ++forgotten; });
  }

  std::vector<FramePlan> asked;
  int forgotten = 0;
  FrameView frame;
  FrameStats stats;
  std::function<void()> fails;
  bool refuses = false;  // sub-frames
  float plain_ms = 1.0f, key_ms = 1.1f, sub_ms = 0.6f;

 private:
  FrameDriver driver_;
};

/// A camera that stays where it is, as forecast.
FrameRequest resting() {
  FrameRequest request;
  request.camera = make_camera({}, {64, 48}, 50.0f);
  request.forecast = Forecast{request.camera.world_from_camera, 8};
  return request;
}

constexpr ViewSettings paper{.pipeline = Pipeline::paper};

/// Draws `frames` frames, and returns how many were sub-frames.
int sub_frames_of(Core& core, int frames) {
  core.asked.clear();
  for (int i = 0; i < frames; ++i) EXPECT_TRUE(core.render(resting()).ok());
  return static_cast<int>(std::ranges::count(core.asked, FrameKind::sub, &FramePlan::kind));
}

constexpr ViewSettings catgs{.pipeline = Pipeline::catgs, .speculation = following_speculation};

TEST(FrameDriver, CatgsHasWindowsWhileTheySaveTime) {
  Core core(catgs, FrameDriver::CatgsWindows::some);
  sub_frames_of(core, 30);
  EXPECT_GT(sub_frames_of(core, 300), 240);
  core.sub_ms = 1.05f;
  core.key_ms = 1.3f;
  sub_frames_of(core, 3000);
  EXPECT_LT(sub_frames_of(core, 600), 30);
  core.sub_ms = 0.6f;
  core.key_ms = 1.1f;
  sub_frames_of(core, 6000);
  EXPECT_GT(sub_frames_of(core, 300), 240);
}

TEST(FrameDriver, AHeavierViewKeepsItsWindows) {
  Core core(catgs, FrameDriver::CatgsWindows::some);
  sub_frames_of(core, 100);
  for (float* ms : {&core.plain_ms, &core.key_ms, &core.sub_ms}) *ms *= 3.0f;
  EXPECT_GT(sub_frames_of(core, 300), 240);
}

TEST(FrameDriver, WindowsThatNeverHoldAreGivenUp) {
  Core core(catgs, FrameDriver::CatgsWindows::some);
  core.refuses = true;
  EXPECT_LT(sub_frames_of(core, 3000), 120);  // were begun
}

TEST(FrameDriver, ASubFrameWhoseListsDoNotHoldIsDrawnAsAKeyFrame) {
  ViewSettings always = catgs;
  always.speculation.where_it_pays = false;
  Core core(always, FrameDriver::CatgsWindows::some);
  core.refuses = true;
  ASSERT_TRUE(core.render(resting()).ok());
  ASSERT_TRUE(core.render(resting()).ok());
  ASSERT_EQ(core.asked.size(), 3u);
  EXPECT_EQ(core.asked[1].kind, FrameKind::sub);
  EXPECT_EQ(core.asked[2].kind, FrameKind::key);
  EXPECT_EQ(core.frame.stats.kind, FrameKind::key);
}

TEST(FrameDriver, CatgsHasNoWindowsWhereACoreHasNone) {
  for (const Pipeline pipeline : {Pipeline::exact, Pipeline::vanilla, Pipeline::catgs}) {
    Core core({.pipeline = pipeline});
    for (int i = 0; i < 3; ++i) ASSERT_TRUE(core.render(resting()).ok());
    ASSERT_EQ(core.asked.size(), 3u);
    for (const FramePlan& plan : core.asked) {
      EXPECT_EQ(plan.kind, FrameKind::key);
      EXPECT_EQ(plan.window, 0);
      EXPECT_EQ(plan.window_end.size_px, resting().camera.size_px);
    }
  }
}

TEST(FrameDriver, SubFramesFollowAKeyFrameAndTheStatisticsSayWhatWasDrawn) {
  Core core(paper);
  const int window = SpeculationSettings{}.initial_window;
  for (int i = 0; i <= window + 1; ++i) {
    ASSERT_TRUE(core.render(resting()).ok());
    const FrameKind expected = i == 0 || i == window + 1 ? FrameKind::key : FrameKind::sub;
    EXPECT_EQ(core.asked.back().kind, expected) << i;
    EXPECT_EQ(core.frame.stats.kind, expected) << i;
    EXPECT_EQ(core.frame.stats.window, window) << i;
  }
}

// The nearest Gaussian decides how far a group may reach, and only a drawn frame tells it.
TEST(FrameDriver, PlansByTheNearestDepthOfTheLastFrame) {
  FrameRequest moving = resting();
  moving.forecast->world_from_camera.position = {0.5f, 0.0f, 0.0f};
  Core near_by(paper), far_away(paper);
  near_by.stats.nearest_depth = 0.5f;
  far_away.stats.nearest_depth = 1000.0f;
  for (Core* core : {&near_by, &far_away}) {
    FrameRequest first = resting();
    first.forecast.reset();
    ASSERT_TRUE(core->render(first).ok());
    ASSERT_TRUE(core->render(moving).ok());
    EXPECT_EQ(core->asked.back().kind, FrameKind::key);
  }
  EXPECT_GT(far_away.asked.back().window, near_by.asked.back().window);
}

TEST(FrameDriver, AFailureIsToldAndEndsTheGroup) {
  const std::vector<std::pair<std::function<void()>, RenderStatus::Code>> failures = {
      {[] { throw std::bad_alloc(); }, RenderStatus::Code::out_of_memory},
      {[] { throw DeviceError(RenderStatus::Code::out_of_memory, "lists"); },
       RenderStatus::Code::out_of_memory},
      {[] { throw DeviceError(RenderStatus::Code::device_failed, "lost"); },
       RenderStatus::Code::device_failed},
      {[] { throw std::runtime_error("of an unknown kind"); }, RenderStatus::Code::device_failed}};
  for (const auto& [fails, code] : failures) {
    Core core(paper);
    ASSERT_TRUE(core.render(resting()).ok());
    core.frame.size_px = {1, 2};
    core.fails = fails;
    EXPECT_EQ(core.render(resting()).code, code);
    EXPECT_EQ(core.forgotten, 1);
    EXPECT_EQ(core.frame.size_px, glm::ivec2(1, 2));  // untouched
    core.fails = nullptr;
    ASSERT_TRUE(core.render(resting()).ok());
    EXPECT_EQ(core.asked.back().kind, FrameKind::key);
  }
}

TEST(FrameDriver, DrawsNothingForABadRequest) {
  Core core(paper);
  FrameRequest request = resting();
  request.camera.near_z = 0.0f;
  EXPECT_EQ(core.render(request).code, RenderStatus::Code::invalid_request);
  EXPECT_TRUE(core.asked.empty());
}

}  // namespace
}  // namespace catgs

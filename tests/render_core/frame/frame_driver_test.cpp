#include "render_core/frame/frame_driver.h"

#include <new>
#include <stdexcept>
#include <vector>

#include <gtest/gtest.h>

#include "render_core/frame/device_error.h"

namespace catgs {
namespace {

/// A core that draws nothing and notes what it is asked for.
class Core {
 public:
  explicit Core(const ViewSettings& settings) : driver_(settings) {}

  RenderStatus render(const FrameRequest& request) {
    return driver_.render(
        request, frame,
        [&](const FramePlan& plan) {
          asked.push_back(plan);
          if (fails) fails();
          FrameView drawn;
          drawn.stats = stats;
          return drawn;
        },
        [&] { ++forgotten; });
  }

  std::vector<FramePlan> asked;
  int forgotten = 0;
  FrameView frame;
  FrameStats stats;
  std::function<void()> fails;

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

TEST(FrameDriver, OnlyThePaperHasGroups) {
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

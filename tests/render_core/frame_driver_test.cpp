#include "render_core/frame_driver.h"

#include <new>
#include <vector>

#include <gtest/gtest.h>

#include "render_core/device_error.h"

namespace catgs {
namespace {

/// A core that draws nothing and notes what it is asked for.
class Core {
 public:
  explicit Core(const ViewSettings& settings) : driver_(settings) {}

  RenderStatus render(const FrameRequest& request) {
    return driver_.render(
        request, frame,
        [&](const FramePlan& plan) -> std::optional<FrameView> {
          asked.push_back(plan);
          if (fails) fails();
          if (lists_lack_something && plan.kind == FrameKind::sub) return std::nullopt;
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
  bool lists_lack_something = false;
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

constexpr ViewSettings catgs{.pipeline = Pipeline::catgs};

TEST(FrameDriver, DrawsEveryFrameAsAKeyFrameWithoutCaches) {
  for (const Pipeline pipeline : {Pipeline::exact, Pipeline::vanilla}) {
    Core core({.pipeline = pipeline});
    for (int i = 0; i < 3; ++i) ASSERT_TRUE(core.render(resting()).ok());
    ASSERT_EQ(core.asked.size(), 3u);
    for (const FramePlan& plan : core.asked) {
      EXPECT_EQ(plan.kind, FrameKind::key);
      EXPECT_EQ(plan.window, 0);
      EXPECT_EQ(plan.grid.tiles, glm::ivec2(4, 3));
      EXPECT_EQ(plan.list_near_z, resting().camera.near_z);
    }
  }
}

TEST(FrameDriver, SubFramesFollowAKeyFrameAndTheStatisticsSayWhatWasDrawn) {
  Core core(catgs);
  const int window = SpeculationSettings{}.initial_window;
  for (int i = 0; i <= window + 1; ++i) {
    ASSERT_TRUE(core.render(resting()).ok());
    const FrameKind expected = i == 0 || i == window + 1 ? FrameKind::key : FrameKind::sub;
    EXPECT_EQ(core.asked.back().kind, expected) << i;
    EXPECT_EQ(core.frame.stats.kind, expected) << i;
    EXPECT_EQ(core.frame.stats.window, window) << i;
  }
}

TEST(FrameDriver, DrawsASubFrameAgainWhoseListsAreNotEnough) {
  Core core(catgs);
  ASSERT_TRUE(core.render(resting()).ok());
  core.lists_lack_something = true;
  ASSERT_TRUE(core.render(resting()).ok());
  ASSERT_EQ(core.asked.size(), 3u);
  EXPECT_EQ(core.asked[1].kind, FrameKind::sub);
  EXPECT_EQ(core.asked[2].kind, FrameKind::key);
  EXPECT_EQ(core.asked[2].window, 0);
  EXPECT_EQ(core.frame.stats.kind, FrameKind::key);
  EXPECT_EQ(core.forgotten, 0);
}

// The nearest Gaussian decides how far a group may reach, and only a drawn frame tells it.
TEST(FrameDriver, PlansByTheDepthsOfTheLastFrame) {
  FrameRequest moving = resting();
  moving.forecast->world_from_camera.position = {0.5f, 0.0f, 0.0f};
  Core near_by(catgs), far_away(catgs);
  near_by.stats.nearest_depth = 0.5f;
  far_away.stats.nearest_depth = 1000.0f;
  near_by.stats.mean_inverse_depth = far_away.stats.mean_inverse_depth = 1e-3f;
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
      {[] { throw DeviceError(RenderStatus::Code::device_failed, "lost"); },
       RenderStatus::Code::device_failed}};
  for (const auto& [fails, code] : failures) {
    Core core(catgs);
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
  Core core(catgs);
  FrameRequest request = resting();
  request.camera.near_z = 0.0f;
  EXPECT_EQ(core.render(request).code, RenderStatus::Code::invalid_request);
  EXPECT_TRUE(core.asked.empty());
}

}  // namespace
}  // namespace catgs

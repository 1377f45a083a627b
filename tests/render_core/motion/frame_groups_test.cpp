#include "render_core/motion/frame_groups.h"

#include <cmath>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "tests/support/refusal.h"

namespace catgs {
namespace {

constexpr float infinity = std::numeric_limits<float>::infinity();

Camera camera_at(const Pose& pose) { return make_camera(pose, {1920, 1080}, 1100.0f); }

Pose moved(glm::vec3 position) { return {position, {1, 0, 0, 0}}; }

Pose turned(float degrees, glm::vec3 axis, glm::vec3 position = glm::vec3(0)) {
  return {position, glm::angleAxis(glm::radians(degrees), axis)};
}

TEST(UniformMotion, IsLinearInPositionAndAngle) {
  const Pose from = turned(10, {0, 1, 0}, {1, 2, 3});
  const Pose to = turned(50, {0, 1, 0}, {5, 2, 1});
  const Pose quarter = uniform_motion(from, to, 0.25f);
  EXPECT_NEAR(glm::distance(quarter.position, {2, 2, 2.5f}), 0.0f, 1e-6f);
  const Pose expected = turned(20, {0, 1, 0});
  EXPECT_NEAR(std::abs(glm::dot(quarter.orientation, expected.orientation)), 1.0f, 1e-6f);
}

TEST(UniformMotion, TakesTheShortWayAndNormalises) {
  Pose to = turned(40, {1, 0, 0});
  to.orientation = -2.0f * to.orientation;
  const Pose half = uniform_motion({}, to, 0.5f);
  EXPECT_NEAR(std::abs(glm::dot(half.orientation, turned(20, {1, 0, 0}).orientation)), 1.0f, 1e-6f);
  const Pose end = uniform_motion({}, to, 1.0f);
  EXPECT_NEAR(glm::length(end.orientation), 1.0f, 1e-6f);
}

TEST(MaxDisplacement, ASidewaysStepMovesTheNearestDepthMost) {
  // u = f x / z: 0.1 units at depth 2 are 1100 * 0.1 / 2 = 55 px everywhere in the image.
  EXPECT_NEAR(max_displacement_px(camera_at({}), moved({0.1f, 0, 0}), 2.0f), 55.0f, 1e-3f);
  EXPECT_NEAR(max_displacement_px(camera_at({}), moved({0.1f, 0, 0}), infinity), 0.0f, 1e-3f);
}

TEST(MaxDisplacement, AStepForwardMovesTheCornersMost) {
  // A point at radius r and depth z moves by r dz / (z - dz).
  const float corner = std::hypot(960.0f, 540.0f);
  EXPECT_NEAR(max_displacement_px(camera_at({}), moved({0, 0, 0.5f}), 2.0f), corner / 3.0f, 1e-2f);
}

TEST(MaxDisplacement, ARotationNeedsNoDepth) {
  // Pan: at the left and right edge x = f tan(phi) goes to f tan(phi +- 1 deg).
  const double edge = std::atan(960.0 / 1100.0);
  const double expected = 1100.0 * std::tan(edge + glm::radians(1.0)) - 960.0;
  const float at_infinity = max_displacement_px(camera_at({}), turned(1, {0, 1, 0}), infinity);
  EXPECT_GE(at_infinity, static_cast<float>(expected));  // corners move in y too
  EXPECT_LE(at_infinity, static_cast<float>(1.2 * expected));
  EXPECT_FLOAT_EQ(max_displacement_px(camera_at({}), turned(1, {0, 1, 0}), 0.4f), at_infinity);
  // Roll: a circle around the centre.
  const float chord = 2.0f * std::hypot(960.0f, 540.0f) * std::sin(glm::radians(2.5f));
  EXPECT_NEAR(max_displacement_px(camera_at({}), turned(5, {0, 0, 1}), 3.0f), chord, 1e-2f);
}

TEST(MaxDisplacement, FollowsTheWorldNotTheAxes) {
  const glm::vec3 axis = glm::normalize(glm::vec3(1, -2, 0.5f));
  const Pose start = turned(70, axis, {4, 5, 6});
  const Pose step = {start.position + start.orientation * glm::vec3(0.1f, 0, 0), start.orientation};
  EXPECT_NEAR(max_displacement_px(camera_at(start), step, 2.0f), 55.0f, 1e-3f);
}

TEST(MaxDisplacement, IsUnboundedThroughTheNearPlaneOrBehindTheCamera) {
  EXPECT_EQ(max_displacement_px(camera_at({}), moved({0, 0, 0.3f}), 0.4f), infinity);
  EXPECT_LT(max_displacement_px(camera_at({}), moved({0, 0, 0.1f}), 0.4f), infinity);
  EXPECT_EQ(max_displacement_px(camera_at({}), turned(180, {0, 1, 0}), infinity), infinity);
}

TEST(MaxDeviation, IsTheDistanceFromTheTrail) {
  const Camera key = camera_at({});
  const Pose end = moved({0.1f, 0, 0});  // trails of 55 px to the left at depth 2
  EXPECT_NEAR(max_deviation_px(key, end, moved({0, 0, 0}), 2.0f), 0.0f, 1e-3f);
  EXPECT_NEAR(max_deviation_px(key, end, moved({0.07f, 0, 0}), 2.0f), 0.0f, 1e-3f);   // early
  EXPECT_NEAR(max_deviation_px(key, end, moved({0.12f, 0, 0}), 2.0f), 11.0f, 1e-3f);  // beyond
  EXPECT_NEAR(max_deviation_px(key, end, moved({-0.02f, 0, 0}), 2.0f), 11.0f, 1e-3f);
  EXPECT_NEAR(max_deviation_px(key, end, moved({0.05f, 0.02f, 0}), 2.0f), 11.0f, 1e-3f);
  EXPECT_EQ(max_deviation_px(key, end, moved({0, 0, 1.9f}), 2.0f), infinity);
}

TEST(MaxDeviation, ATurnNeedsNoDepth) {
  const Camera key = camera_at({});
  const float turn = max_displacement_px(key, turned(1, {0, 1, 0}), infinity);
  EXPECT_FLOAT_EQ(max_deviation_px(key, {}, turned(1, {0, 1, 0}), infinity), turn);
  EXPECT_NEAR(max_deviation_px(key, turned(2, {0, 0, 1}), turned(1, {0, 0, 1}), infinity),
              std::hypot(960.0f, 540.0f) * (1.0f - std::cos(glm::radians(1.0f))), 1e-2f);
}

TEST(SpeculationWindow, IsThePapersRule) {
  EXPECT_EQ(speculation_window(4, 16.0f, 0.0f), 4);
  EXPECT_EQ(speculation_window(4, 16.0f, 16.0f), 4);
  EXPECT_EQ(speculation_window(4, 16.0f, 16.1f), 3);
  EXPECT_EQ(speculation_window(4, 16.0f, 33.0f), 1);
  EXPECT_EQ(speculation_window(4, 16.0f, 64.0f), 1);
  EXPECT_EQ(speculation_window(4, 16.0f, 64.1f), 0);
  EXPECT_EQ(speculation_window(4, 16.0f, infinity), 0);
  EXPECT_EQ(speculation_window(0, 16.0f, 1.0f), 0);
}

TEST(Speculation, SettingsAreChecked) {
  const auto refused = [](const SpeculationSettings& settings) {
    return test::refusal_of([&] { FrameGroups groups(settings); }).source;
  };
  EXPECT_EQ(refused({.initial_window = -1}), "--window");
  EXPECT_EQ(refused({.initial_window = 65}), "--window");
  EXPECT_EQ(refused({.max_trail_px = 0}), "--max-trail-px");
  EXPECT_EQ(refused({.min_depth = std::nanf("")}), "--min-depth");
  EXPECT_EQ(refused({.max_deviation_px = infinity}), "--max-deviation-px");
  EXPECT_FLOAT_EQ(speculation_min_depth({}, 0.3f), 0.6f);
  EXPECT_FLOAT_EQ(speculation_min_depth({.min_depth = 0.4f}, 0.3f), 0.4f);
}

/// Sideways at `step` world units a frame, forecast right: kinds of the frames as a string.
std::string kinds(const SpeculationSettings& settings, int frames, float step, float depth,
                  int horizon = 4) {
  FrameGroups groups(settings);
  std::string kinds;
  for (int i = 0; i < frames; ++i) {
    const float x = static_cast<float>(i) * step;
    const Forecast forecast{moved({x + step * static_cast<float>(horizon), 0, 0}), horizon};
    const FramePlan plan = groups.plan(camera_at(moved({x, 0, 0})), forecast, depth);
    kinds += plan.kind == FrameKind::key ? 'k' : 's';
  }
  return kinds;
}

TEST(FrameGroups, AKeyFrameAndWSubFrames) {
  EXPECT_EQ(kinds({}, 11, 0.0f, 1.0f), "ksssskssssk");
  EXPECT_EQ(kinds({.initial_window = 0}, 4, 0.0f, 1.0f), "kkkk");
}

TEST(FrameGroups, FastMotionShrinksTheWindow) {
  // 1100 px * 0.01 / 1 = 11 px a frame, 44 px in four: W = floor(4 * 16 / 44) = 1.
  EXPECT_EQ(kinds({}, 6, 0.01f, 1.0f), "ksksks");
  EXPECT_EQ(kinds({}, 6, 0.01f, 3.0f), "kssssk");
  EXPECT_EQ(kinds({}, 6, 0.01f, infinity), "kssssk");
  EXPECT_EQ(kinds({}, 4, 0.02f, 1.0f), "kkkk");
  EXPECT_EQ(kinds({.max_trail_px = 32.0f}, 6, 0.01f, 1.0f), "ksskss");
}

TEST(FrameGroups, UnknownOrTooSmallDepthsMeanTheDepthThreshold) {
  // d = 2 x 0.2: 4 frames of 0.001 are 1100 * 0.004 / 0.4 = 11 px; of 0.002 22 px, so W = 2.
  for (const float depth : {0.0f, 0.1f, std::nanf("")}) {
    EXPECT_EQ(kinds({}, 6, 0.001f, depth), "kssssk");
    EXPECT_EQ(kinds({}, 6, 0.002f, depth), "ksskss");
  }
}

TEST(FrameGroups, NeverGoBeyondTheForecast) {
  EXPECT_EQ(kinds({.initial_window = 8}, 6, 0.0f, 1.0f, 2), "ksskss");
}

TEST(FrameGroups, PlansTheCameraAtTheEndOfTheWindow) {
  FrameGroups groups{SpeculationSettings{}};
  const Forecast forecast{turned(4, {0, 0, 1}, {0.08f, 0, 0}), 8};
  const Camera now = camera_at({});
  const FramePlan plan = groups.plan(now, forecast, 10.0f);  // 38 px by roll, 4.4 px by the step
  EXPECT_EQ(plan.kind, FrameKind::key);
  EXPECT_EQ(plan.window, 1);
  EXPECT_NEAR(plan.window_end.world_from_camera.position.x, 0.01f, 1e-6f);
  EXPECT_NEAR(glm::degrees(glm::angle(plan.window_end.world_from_camera.orientation)), 0.5f, 1e-3f);
  EXPECT_EQ(plan.window_end.size_px, now.size_px);
  const FramePlan sub = groups.plan(plan.window_end, forecast, 10.0f);
  EXPECT_EQ(sub.kind, FrameKind::sub);
  EXPECT_EQ(sub.window, 1);
}

TEST(FrameGroups, AFrameWithoutForecastEndsTheWindow) {
  FrameGroups groups{SpeculationSettings{}};
  const Forecast still{camera_at({}).world_from_camera, 4};
  EXPECT_EQ(groups.plan(camera_at({}), still, 1.0f).window, 4);
  EXPECT_EQ(groups.plan(camera_at({}), still, 1.0f).kind, FrameKind::sub);
  for (int i = 0; i < 3; ++i) {
    const FramePlan plan = groups.plan(camera_at({}), std::nullopt, 1.0f);
    EXPECT_EQ(plan.kind, FrameKind::key);
    EXPECT_EQ(plan.window, 0);
  }
  EXPECT_EQ(groups.plan(camera_at({}), still, 1.0f).kind, FrameKind::key);
}

/// A group whose forecast is 4 frames of 0.01 units to the right, at depth 20: 0.55 px a frame.
class OpenGroup : public ::testing::Test {
 protected:
  OpenGroup() { groups_.plan(camera_at({}), Forecast{moved({0.04f, 0, 0}), 4}, depth); }
  FrameKind next(const Camera& camera, float nearest = depth) {
    return groups_.plan(camera, Forecast{camera.world_from_camera, 4}, nearest).kind;
  }
  static constexpr float depth = 20.0f;
  FrameGroups groups_{SpeculationSettings{}};
};

TEST_F(OpenGroup, GoesOnWhereItWasForecast) {
  EXPECT_EQ(next(camera_at(moved({0.01f, 0, 0}))), FrameKind::sub);
  EXPECT_EQ(next(camera_at(moved({0.02f, 0, 0}))), FrameKind::sub);
}

TEST_F(OpenGroup, EndsWhereTheCameraLeavesThePath) {
  // 3 px at depth 20 are 0.055 units.
  EXPECT_EQ(next(camera_at(moved({0.01f, 0.03f, 0}))), FrameKind::sub);
  EXPECT_EQ(next(camera_at(moved({0.02f, 0.06f, 0}))), FrameKind::key);
}

TEST_F(OpenGroup, EndsWhereTheViewTurnsAway) {
  EXPECT_EQ(next(camera_at(turned(0.05f, {0, 1, 0}, {0.01f, 0, 0}))), FrameKind::sub);
  EXPECT_EQ(next(camera_at(turned(0.2f, {0, 1, 0}, {0.02f, 0, 0}))), FrameKind::key);
}

TEST_F(OpenGroup, GoesOnWhenTheCameraStops) {
  for (int i = 0; i < 4; ++i) EXPECT_EQ(next(camera_at({})), FrameKind::sub);
  EXPECT_EQ(next(camera_at({})), FrameKind::key);
}

TEST_F(OpenGroup, EndsWhenSomethingNearComesIntoView) {
  EXPECT_EQ(next(camera_at(moved({0.01f, 0.01f, 0}))), FrameKind::sub);
  EXPECT_EQ(next(camera_at(moved({0.02f, 0.01f, 0})), 0.5f), FrameKind::key);
}

TEST_F(OpenGroup, EndsWithAnotherLens) {
  const Pose expected = moved({0.01f, 0, 0});
  std::vector<Camera> others(4, camera_at(expected));
  others[0].size_px.x += 16;
  others[1].focal_px.y *= 1.01f;
  others[2].principal_point_px.x += 1.0f;
  others[3].near_z = 0.1f;
  for (const Camera& other : others) {
    FrameGroups groups{SpeculationSettings{}};
    groups.plan(camera_at({}), Forecast{moved({0.04f, 0, 0}), 4}, depth);
    EXPECT_EQ(groups.plan(other, std::nullopt, depth).kind, FrameKind::key);
  }
}

TEST_F(OpenGroup, EndsWhenTheCachesAreGone) {
  groups_.forget();
  EXPECT_EQ(next(camera_at(moved({0.01f, 0, 0}))), FrameKind::key);
  EXPECT_EQ(next(camera_at(moved({0.01f, 0, 0}))), FrameKind::sub);
}

/// A group on a grid that follows a turn of 0.2 degrees a frame: 3.84 px in the middle.
class FollowingGroup : public ::testing::Test {
 protected:
  static constexpr float rate_deg = 0.2f, depth = 5.0f;

  FollowingGroup() {
    first_ = groups_.plan(camera_at({}), Forecast{turned(8 * rate_deg, {0, 1, 0}), 8}, depth);
  }
  FramePlan next(const Camera& camera) {
    return groups_.plan(camera, Forecast{camera.world_from_camera, 8}, depth);
  }

  FrameGroups groups_{following_speculation, TileGrid::follows};
  FramePlan first_;
};

TEST_F(FollowingGroup, ATurnMovesTheGridAndLeavesShortTrails) {
  EXPECT_EQ(first_.window, 4);
  EXPECT_EQ(first_.end_shift_px, glm::ivec2(-15, 0));  // 1100 tan(0.8 degrees)
  const FramePlan fixed = FrameGroups{SpeculationSettings{.initial_window = 12}}.plan(
      camera_at({}), Forecast{turned(8 * rate_deg, {0, 1, 0}), 8}, depth);
  EXPECT_EQ(fixed.window, 2);
  EXPECT_EQ(fixed.end_shift_px, glm::ivec2(0));
}

TEST_F(FollowingGroup, TheGridIsWhereTheCameraReallyIs) {
  const FramePlan sub = next(camera_at(turned(1.3f * rate_deg, {0, 1, 0})));
  EXPECT_EQ(sub.kind, FrameKind::sub);
  EXPECT_EQ(sub.shift_px, glm::ivec2(-5, 0));  // 1100 tan(0.26 degrees)
}

TEST_F(FollowingGroup, EndsBeyondTheMarginOfTheGrid) {
  SpeculationSettings settings = following_speculation;
  settings.max_deviation_px = 50.0f;
  for (const auto& [degrees, kind] :
       {std::pair(-0.3f, FrameKind::sub), std::pair(-0.5f, FrameKind::key)}) {  // 9.6 px
    FrameGroups groups(settings, TileGrid::follows);
    groups.plan(camera_at({}), Forecast{turned(8 * rate_deg, {0, 1, 0}), 8}, depth);
    const Camera now = camera_at(turned(degrees, {0, 1, 0}));
    EXPECT_EQ(groups.plan(now, Forecast{now.world_from_camera, 8}, depth).kind, kind);
  }
}

TEST_F(FollowingGroup, EndsWhereParallaxLeavesTheForecast) {
  const Pose ahead = turned(rate_deg, {0, 1, 0}, {0, 0, 0.01f});
  const Pose sideways = turned(rate_deg, {0, 1, 0}, {0.05f, 0, 0});  // 11 px, against infinity
  EXPECT_EQ(next(camera_at(ahead)).kind, FrameKind::sub);
  EXPECT_EQ(next(camera_at(sideways)).kind, FrameKind::key);
}

TEST(FrameGroups, AGridThatFollowsHasABound) {
  SpeculationSettings settings = following_speculation;
  settings.max_trail_px = 1e6f;
  FrameGroups groups(settings, TileGrid::follows);
  const FramePlan plan =
      groups.plan(camera_at({}), Forecast{turned(12, {0, 1, 0}), 12}, 5.0f);  // 234 px
  EXPECT_EQ(plan.window, 4);
  EXPECT_EQ(plan.end_shift_px, glm::ivec2(-77, 0));  // 1100 tan(4 degrees)
}

}  // namespace
}  // namespace catgs

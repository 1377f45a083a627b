#include "render_core/motion/trace_check.h"

#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace catgs {
namespace {

using ::testing::HasSubstr;

const Bounds bounds{glm::vec3(-1), glm::vec3(1)};
const Camera lens = make_camera({}, {100, 100}, 50.0f);  // 90 degrees

/// A wall of 10 x 10 points at z = 0.5, seen whole from z = -0.5.
std::vector<glm::vec3> wall() {
  std::vector<glm::vec3> points;
  for (int i = 0; i < 100; ++i) {
    points.emplace_back(0.1f * static_cast<float>(i % 10) - 0.45f,
                        0.1f * static_cast<float>(i / 10) - 0.45f, 0.5f);
  }
  return points;
}

/// `count` frames that look at the wall; those from `away` on look back, `out` and the
/// next one stand outside.
Trajectory looking(int count, int away, int out) {
  Trajectory path;
  for (int i = 0; i < count; ++i) {
    Pose pose{{0, 0, i == out || i == out + 1 ? -1.5f : -0.5f}, {1, 0, 0, 0}};
    if (i >= away) pose.orientation = {0, 0, 1, 0};
    path.push_back({i * 1000, pose});
  }
  return path;
}

/// People look at the wall from z = -0.5.
SceneHints hints() {
  SceneHints hints;
  hints.start_pose.position = {0, 0, -0.5f};
  hints.focus = {0, 0, 0.5f};
  return hints;
}

TraceCheck check(const Trajectory& path) {
  ThreadPool pool(2);
  return check_trace(path, wall(), {bounds, hints()}, lens, pool);
}

TEST(TraceCheck, AcceptsATraceThatSeesTheScene) {
  const TraceCheck result = check(looking(100, 95, 1000));
  EXPECT_TRUE(result.valid());
  EXPECT_EQ(result.complaint(), "");
  EXPECT_DOUBLE_EQ(result.seeing_frames, 0.95);
  EXPECT_EQ(result.emptiest_frame, 95u);
  EXPECT_EQ(result.emptiest_in_view, 0.0);
}

TEST(TraceCheck, FindsFramesThatSeeNothing) {
  const TraceCheck result = check(looking(100, 94, 1000));
  EXPECT_FALSE(result.valid());
  EXPECT_THAT(result.complaint(), HasSubstr("only 94.0 % of 100 frames"));
  EXPECT_THAT(result.complaint(), HasSubstr("frame 94 sees 0.0 %"));
}

TEST(TraceCheck, FindsCamerasOutside) {
  const TraceCheck result = check(looking(100, 100, 17));
  EXPECT_FALSE(result.valid());
  EXPECT_EQ(result.outside_frames, 2u);
  EXPECT_EQ(result.first_outside, 17u);
  EXPECT_THAT(result.complaint(), HasSubstr("2 of 100 frames lie outside"));
  EXPECT_THAT(result.complaint(), HasSubstr("first: 17"));
}

TEST(TraceCheck, AnObjectIsSeenFromAroundIt) {
  SceneHints object = hints();
  object.start_pose.position = {0, 0, -1.5f};
  ThreadPool pool(1);
  const auto outside = [&](float z) {
    const Trajectory path = {{0, {{0, 0, z}, {1, 0, 0, 0}}}};
    return check_trace(path, wall(), {bounds, object}, lens, pool).outside_frames;
  };
  EXPECT_EQ(outside(-1.5f), 0u);
  EXPECT_EQ(outside(-1.6f), 1u) << "farther than the first view";
}

TEST(TraceCheck, ATenthInViewIsEnough) {
  const TimedPose whole{0, {{0, 0, -0.5f}, {1, 0, 0, 0}}};
  // The view is 1 unit wide to each side at the wall: from x = 1 only points beyond x = 0 …
  const auto from = [&](float x) { return check({whole, {1, {{x, 0, -0.5f}, {1, 0, 0, 0}}}}); };
  EXPECT_DOUBLE_EQ(from(0.99f).emptiest_in_view, 0.5);
  EXPECT_TRUE(from(0.99f).valid());
  // … and from z = 0 half as much.
  const auto nearer = [&](float x) { return check({whole, {1, {{x, 0, 0.0f}, {1, 0, 0, 0}}}}); };
  EXPECT_DOUBLE_EQ(nearer(0.90f).emptiest_in_view, 0.1);
  EXPECT_TRUE(nearer(0.90f).valid());
  EXPECT_DOUBLE_EQ(nearer(0.99f).emptiest_in_view, 0.0);
  EXPECT_FALSE(nearer(0.99f).valid());
}

TEST(TraceCheck, AnEmptySceneOrTraceIsNotFit) {
  ThreadPool pool(1);
  EXPECT_FALSE(check_trace(looking(3, 3, 9), {}, {bounds, hints()}, lens, pool).valid());
  EXPECT_FALSE(check_trace({}, wall(), {bounds, hints()}, lens, pool).valid());
}

}  // namespace
}  // namespace catgs

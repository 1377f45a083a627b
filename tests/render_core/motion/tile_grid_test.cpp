#include "render_core/motion/tile_grid.h"

#include <cmath>
#include <vector>

#include <gtest/gtest.h>

#include "render_core/math/camera-inl.h"
#include "render_core/math/growth-inl.h"
#include "render_core/math/homography-inl.h"
#include "render_core/math/sweep-inl.h"
#include "tests/support/random_source.h"

namespace catgs {
namespace {

Camera camera_at(const Pose& pose) { return make_camera(pose, {1920, 1080}, 1100.0f); }

Pose turned(float degrees, glm::vec3 axis, glm::vec3 position = glm::vec3(0)) {
  return {position, glm::angleAxis(glm::radians(degrees), glm::normalize(axis))};
}

TEST(ImageTurn, TakesPixelsToWhereTheKeyFrameShowsThem) {
  const Camera key = camera_at(turned(30, {1, 2, 0.5f}, {3, 4, 5}));
  Camera frame = key;
  frame.world_from_camera.orientation =
      key.world_from_camera.orientation * turned(4, {0.2f, 1, 0.4f}).orientation;
  const auto key_model = math::make_camera_model(key), model = math::make_camera_model(frame);
  const Homography<double> turn = image_turn(key, frame.world_from_camera);
  const Homography<double> back = math::inverse(turn);
  for (const glm::dvec3 offset : {glm::dvec3(1, 2, 9), glm::dvec3(-3, 1, 8), glm::dvec3(0, 0, 1)}) {
    const glm::dvec3 point = glm::dvec3(key.world_from_camera.position) +
                             glm::dquat(key.world_from_camera.orientation) * offset;
    const math::Vec3<double> world{point.x, point.y, point.z};
    const auto in_key = math::image_px(key_model, math::camera_from_world(key_model, world));
    const auto in_frame = math::image_px(model, math::camera_from_world(model, world));
    const auto mapped = math::apply(turn, in_frame);
    EXPECT_NEAR(mapped.x, in_key.x, 1e-3);
    EXPECT_NEAR(mapped.y, in_key.y, 1e-3);
    const auto returned = math::apply(back, in_key);
    EXPECT_NEAR(returned.x, in_frame.x, 1e-3);
    EXPECT_NEAR(returned.y, in_frame.y, 1e-3);
  }
}

TEST(ImageShift, IsThatOfTheMiddle) {
  const Camera key = camera_at({});
  EXPECT_EQ(image_shift_px(key, {}), glm::ivec2(0));
  // What a camera that turned right by 1 degree shows in the middle, the key frame shows f tan(1
  // degree) = 19.2 px farther right.
  EXPECT_EQ(image_shift_px(key, turned(1, {0, 1, 0})), glm::ivec2(19, 0));
  EXPECT_EQ(image_shift_px(key, turned(-2, {1, 0, 0})), glm::ivec2(0, 38));
  EXPECT_EQ(image_shift_px(key, turned(10, {0, 0, 1})), glm::ivec2(0));
  EXPECT_EQ(image_shift_px(key, turned(170, {0, 1, 0})), key.size_px);
}

TEST(Grids, CoverWhatTheyShould) {
  const TileGrid image = image_grid({1920, 1080});
  EXPECT_EQ(image.tiles, glm::ivec2(120, 68));
  EXPECT_EQ(image.size_px, glm::ivec2(1920, 1080));
  const TileGrid wider = covering_grid({-17.0, 0.0}, {1920.0, 1081.0});
  EXPECT_EQ(wider.first_px, glm::ivec2(-32, 0));
  EXPECT_EQ(wider.tiles, glm::ivec2(122, 68));
}

TEST(GuardSets, HoldTheForecastAndALittleMore) {
  const Camera key = camera_at({});
  const Pose end = turned(2, {0, 1, 0}, {0.1f, 0, 0});
  const GuardSet guard = make_guard_set(key, end, 0.01);
  for (const float share : {0.0f, 0.3f, 0.5f, 1.0f})
    EXPECT_TRUE(in_guard_set(guard, key, end, turned(2 * share, {0, 1, 0}, {0.1f * share, 0, 0})));
  EXPECT_TRUE(in_guard_set(guard, key, end, turned(1, {0, 1, 0.2f}, {0.05f, 0.005f, 0})));
  EXPECT_FALSE(in_guard_set(guard, key, end, turned(1, {0, 1, 0}, {0.05f, 0.02f, 0})));
  EXPECT_FALSE(in_guard_set(guard, key, end, turned(-1, {0, 1, 0})));
  EXPECT_FALSE(in_guard_set(guard, key, end, turned(4, {0, 1, 0})));
}

TEST(GuardSets, OfLongLensesStayWithinBounds) {
  for (const float focal_px : {1e4f, 1e6f, 1e8f}) {
    const Camera key = make_camera({}, {1920, 1080}, focal_px);
    const GuardSet still = make_guard_set(key, {}, 0.0);
    EXPECT_TRUE(in_guard_set(still, key, {}, {}));
    EXPECT_LE(still.grid.size_px.x, 2 * 1920 + 160);
    EXPECT_LE(still.grid.size_px.y, 2 * 1080 + 160);
    const Pose end = turned(2, {0, 1, 0});
    const GuardSet turning = make_guard_set(key, end, 0.0);
    EXPECT_LE(turning.grid.size_px.x, 4 * 1920 + 256);
    EXPECT_EQ(in_guard_set(turning, key, end, end), focal_px < 1e5f);
  }
}

TEST(GuardSets, EndWhereTilesWouldHaveTooManyPixels) {
  const Camera key = camera_at({});
  const Pose end = turned(6, {0, 1, 0});
  EXPECT_FALSE(in_guard_set(make_guard_set(key, end, most_tau(key)), key, end, end));
  Camera wide = key;
  wide.focal_px = {600.0f, 600.0f};
  const Pose less = turned(3.5f, {0, 1, 0});
  EXPECT_FALSE(in_guard_set(make_guard_set(wide, less, most_tau(wide)), wide, less, less));
}

/// A Gaussian of a random cloud, seen by a camera at the origin.
struct RandomGaussian {
  math::Vec3<double> mean;
  math::CovarianceFactor<double> factor;
};

class ListGrowthTest : public ::testing::Test {
 protected:
  double uniform(double low, double high) { return random_.uniform(low, high); }
  glm::dvec3 direction() { return random_.direction(); }
  RandomGaussian gaussian() {
    const double depth = std::exp(uniform(std::log(0.4), std::log(60.0)));
    const glm::dvec3 axis = direction();
    const double angle = uniform(0.0, 3.0), sine = std::sin(0.5 * angle);
    const double rotation[4] = {axis.x * sine, axis.y * sine, axis.z * sine, std::cos(0.5 * angle)};
    const auto scale = [&] { return depth * std::exp(uniform(std::log(1e-4), std::log(0.1))); };
    return {{depth * uniform(-1.2, 1.2), depth * uniform(-0.8, 0.8), depth},
            math::covariance_factor<double>(rotation, {scale(), scale(), scale()})};
  }

  test::RandomSource random_{7};
};

// What a camera of the guard set shows of a Gaussian lies inside what the key frame lists, wherever
// the camera is in the set.
TEST_F(ListGrowthTest, CoversEveryCameraOfTheGuardSet) {
  int checked = 0;
  for (int trial = 0; trial < 120; ++trial) {
    Camera key = camera_at({});
    if (trial % 2 == 1) key.focal_px.y *= 0.5f;
    const auto now = math::make_camera_model(key);
    const bool rolls = trial % 3 == 0;
    const glm::dvec3 axis = rolls ? glm::dvec3(0.0, 0.0, 1.0) : direction();
    const Pose end{glm::vec3(0.03 * direction()),
                   glm::quat(glm::angleAxis(glm::radians(uniform(0.0, rolls ? 8.0 : 3.0)), axis))};
    const double tau = trial % 5 == 0 ? most_tau(key) : 0.002;
    const GuardSet guard = make_guard_set(key, end, tau);
    if (!in_guard_set(guard, key, end, end)) continue;
    const ListGrowth<double> growth = list_growth(key, guard);
    Camera last = key;
    last.world_from_camera.position = end.position;
    const auto at_end = math::make_camera_model(last);
    Camera frame = key;
    const double share = uniform(0.0, 1.0);
    frame.world_from_camera.position =
        glm::vec3(share * glm::dvec3(end.position) + 0.99 * tau * direction());
    frame.world_from_camera.orientation =
        glm::quat(glm::angleAxis(glm::radians(uniform(-0.3, 0.3)), direction()) *
                  glm::slerp(glm::dquat(1, 0, 0, 0), glm::dquat(end.orientation), share));
    if (!in_guard_set(guard, key, end, frame.world_from_camera)) continue;
    const auto shown = math::make_camera_model(frame);
    const Homography<double> turn = image_turn(key, frame.world_from_camera);
    const double reach = math::reach_of(0.0);  // of an opaque one
    for (int i = 0; i < 500; ++i) {
      const RandomGaussian g = gaussian();
      const double depth = math::view_depth(now, g.mean);
      const double shown_depth = math::view_depth(shown, g.mean);
      if (depth < now.near_z || shown_depth < now.near_z) continue;
      const auto s = math::sweep(now, at_end, g.mean, g.factor, depth);
      const auto half = math::half_extent(s.outline, reach);
      const double grow = math::growth_px<double>(
          growth,
          {(s.shape.centre_px.x - now.principal_point_px.x) / now.focal_px.x,
           (s.shape.centre_px.y - now.principal_point_px.y) / now.focal_px.y},
          std::min(depth, math::view_depth(at_end, g.mean)), std::hypot(half.x, half.y));
      const auto trail = math::make_trail(
          math::make_ellipse(s.outline, reach, half.x, math::rightmost_y(s.outline, reach)),
          s.displacement);
      const auto there = math::project(shown, g.mean, g.factor, shown_depth);
      const auto w = math::whitening(there);
      for (int k = 0; k < 8; ++k) {
        const double angle = 0.25 * glm::pi<double>() * (k + uniform(0.0, 1.0));
        const double v = std::sqrt(reach) * std::sin(angle) / w.yy;
        const double u = (std::sqrt(reach) * std::cos(angle) - w.xy * v) / w.xx;
        const math::Vec2<double> edge{there.centre_px.x + u, there.centre_px.y + v};
        if (edge.x < 0 || edge.y < 0 || edge.x > 1920 || edge.y > 1080) continue;
        const auto at = math::apply(turn, edge);
        const double x = at.x - s.shape.centre_px.x, y = at.y - s.shape.centre_px.y;
        // A tile holds the point; listing tests its square, half a pixel outside its centres.
        const double reached = grow - 0.5 + 0.01;
        const auto columns = math::columns_in_band(trail, y - reached, y + reached);
        ++checked;
        ASSERT_LE(columns.low, columns.high) << "rows, growth " << grow;
        EXPECT_GE(x, columns.low - reached) << "growth " << grow << " of " << half.x;
        EXPECT_LE(x, columns.high + reached) << "growth " << grow << " of " << half.x;
      }
    }
  }
  EXPECT_GT(checked, 50'000);
}

}  // namespace
}  // namespace catgs

// Trails against distances in the whitened plane, which know nothing of rows and columns, and
// against brute force over pixels and steps of the path.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iostream>
#include <random>

#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <gtest/gtest.h>

#include "render_core/math/constants.h"
#include "render_core/math/trail-inl.h"

namespace catgs {
namespace {

constexpr double tile = tile_size_px;

/// An ellipse on its way, in float as a renderer has it: what is listed may depend on rounding, but
/// must cover the ellipse of exactly these numbers.
struct Case {
  math::ProjectedGaussian<float> shape;
  math::Whitening<float> w;
  float reach;
  math::Vec2<float> displacement;
  glm::dvec2 first_px;  // first pixel centre of the first tile, from the ellipse's centre
};

class RandomCases {
 public:
  Case next() {
    // Axes from the low-pass to ten thousand pixels, needles among them; reach up to log2(255).
    const double long_axis = std::exp(uniform(std::log(0.55), std::log(one_in(8) ? 1e4 : 60.0)));
    const double short_axis = one_in(3) ? 0.55 : std::max(0.55, long_axis * uniform(0.01, 1.0));
    const double angle = one_in(8) ? std::floor(uniform(0, 4)) * M_PI / 2 : uniform(0.0, M_PI);
    const glm::dvec2 axis(std::cos(angle), std::sin(angle));
    const double l2 = long_axis * long_axis, s2 = short_axis * short_axis;
    Case c;
    c.shape = {{0.0f, 0.0f},
               static_cast<float>(l2 * axis.x * axis.x + s2 * axis.y * axis.y),
               static_cast<float>((l2 - s2) * axis.x * axis.y),
               static_cast<float>(l2 * axis.y * axis.y + s2 * axis.x * axis.x),
               static_cast<float>(l2 * s2),
               0.0f};
    c.w = math::whitening(c.shape);
    c.reach = static_cast<float>(one_in(20) ? uniform(0.0, 1e-3) : uniform(0.0, 7.9943));
    c.displacement = displacement(axis);
    // Near the rim, where decisions are made: around a point of the trail, somewhat outwards.
    const double turn = uniform(0.0, 2.0 * M_PI);
    const double sigmas = std::sqrt(c.reach) / exponent_scale * uniform(0.7, 1.1);
    const glm::dvec2 on_rim = axis * (long_axis * sigmas * std::cos(turn)) +
                              glm::dvec2(-axis.y, axis.x) * (short_axis * sigmas * std::sin(turn));
    const double share = one_in(3) ? std::floor(uniform(0, 2)) : uniform(0.0, 1.0);
    c.first_px = on_rim + share * glm::dvec2(c.displacement.x, c.displacement.y) -
                 glm::dvec2(uniform(0, 5), uniform(0, 5)) * tile;
    return c;
  }

 private:
  double uniform(double low, double high) {
    return low + (high - low) * static_cast<double>(engine_() >> 11) * 0x1p-53;
  }
  bool one_in(int n) { return engine_() % static_cast<std::uint64_t>(n) == 0; }

  math::Vec2<float> displacement(const glm::dvec2& axis) {
    const double length = std::exp(uniform(std::log(1e-3), std::log(one_in(5) ? 3000.0 : 40.0)));
    const double turn = uniform(0.0, 2.0 * M_PI);
    switch (engine_() % 16) {
      case 0:
        return {0.0f, 0.0f};
      case 1:
        return {static_cast<float>(one_in(2) ? length : -length), 0.0f};
      case 2:
        return {0.0f, static_cast<float>(one_in(2) ? length : -length)};
      case 3:  // nearly along the rows
        return {static_cast<float>(length), static_cast<float>(uniform(-1e-4, 1e-4))};
      case 4:  // along the ellipse
        return {static_cast<float>(length * axis.x), static_cast<float>(length * axis.y)};
      default:
        return {static_cast<float>(length * std::cos(turn)),
                static_cast<float>(length * std::sin(turn))};
    }
  }

  std::mt19937_64 engine_{2026};
};

double squared_distance_to_segment(const glm::dvec2& a, const glm::dvec2& b) {
  const glm::dvec2 along = b - a;
  const double length2 = glm::dot(along, along);
  const double share = length2 > 0.0 ? std::clamp(-glm::dot(a, along) / length2, 0.0, 1.0) : 0.0;
  const glm::dvec2 nearest = a + share * along;
  return glm::dot(nearest, nearest);
}

/// Does the segment from 0 to d meet the box [low, high]?
bool segment_meets_box(const glm::dvec2& d, const glm::dvec2& low, const glm::dvec2& high) {
  double enter = 0.0, leave = 1.0;
  for (int axis = 0; axis < 2; ++axis) {
    if (d[axis] == 0.0) {
      if (low[axis] > 0.0 || high[axis] < 0.0) return false;
      continue;
    }
    const double a = low[axis] / d[axis], b = high[axis] / d[axis];
    enter = std::max(enter, std::min(a, b));
    leave = std::min(leave, std::max(a, b));
  }
  return enter <= leave;
}

/// Squared whitened distance between the path and a box, both taken as sets of points: where the
/// path misses the box, the distance of 0 from the box swept backwards, whose rim is made of the
/// box's edges at both ends and of its corners' paths.
double squared_distance(const Case& c, const glm::dvec2& low, const glm::dvec2& high) {
  const glm::dvec2 d(c.displacement.x, c.displacement.y);
  if (segment_meets_box(d, low, high)) return 0.0;
  const auto whiten = [&](const glm::dvec2& p) {
    return glm::dvec2(double(c.w.xx) * p.x + double(c.w.xy) * p.y, double(c.w.yy) * p.y);
  };
  const glm::dvec2 corners[4] = {low, {high.x, low.y}, high, {low.x, high.y}};
  double least = INFINITY;
  for (int i = 0; i < 4; ++i) {
    const glm::dvec2 a = corners[i], b = corners[(i + 1) % 4];
    least = std::min({least, squared_distance_to_segment(whiten(a), whiten(b)),
                      squared_distance_to_segment(whiten(a - d), whiten(b - d)),
                      squared_distance_to_segment(whiten(a), whiten(a - d))});
  }
  return least;
}

template <class T>
math::Trail<T> trail_of(const Case& c) {
  const math::Whitening<T> w{T(c.w.xx), T(c.w.xy), T(c.w.yy)};
  const math::ProjectedGaussian<T> shape{{T(0), T(0)},           T(c.shape.xx),
                                         T(c.shape.xy),          T(c.shape.yy),
                                         T(c.shape.determinant), T(c.shape.sharp_determinant)};
  const T reach = T(c.reach);
  return math::make_trail(
      math::make_ellipse(w, reach, math::half_extent(shape, reach).x, math::rightmost_y(w, reach)),
      {T(c.displacement.x), T(c.displacement.y)});
}

/// As the renderers list tiles: with listing_slack_px around the columns.
template <class T>
bool lists(const math::Interval<T>& columns, double first_x) {
  return columns.low <= columns.high &&
         static_cast<double>(columns.low) - listing_slack_px <= first_x + tile - 1.0 &&
         static_cast<double>(columns.high) + listing_slack_px >= first_x;
}

TEST(Trail, MissesNoTileAndAddsFew) {
  constexpr int cases = 1'000'000, side = 5;
  RandomCases random;
  std::uint64_t met = 0, extra = 0, extra_double = 0, missed = 0, missed_double = 0, apart = 0;
  for (int n = 0; n < cases; ++n) {
    const Case c = random.next();
    const auto trail = trail_of<float>(c);
    const auto precise = trail_of<double>(c);
    for (int row = 0; row < side; ++row) {
      const double low_y = c.first_px.y + row * tile, high_y = low_y + tile - 1.0;
      // Floats of band and boxes are the same numbers for all: the oracle takes them from float.
      const auto low = static_cast<float>(low_y), high = static_cast<float>(high_y);
      const auto columns = math::columns_in_band(trail, low, high);
      const auto columns_double =
          math::columns_in_band(precise, static_cast<double>(low), static_cast<double>(high));
      for (int column = 0; column < side; ++column) {
        const double first_x = c.first_px.x + column * tile;
        const bool expected = squared_distance(c, {first_x, low}, {first_x + tile - 1.0, high}) <=
                              static_cast<double>(c.reach);
        const bool listed = lists(columns, first_x);
        const bool listed_double = lists(columns_double, first_x);
        met += expected;
        extra += listed && !expected;
        extra_double += listed_double && !expected;
        missed += !listed && expected;
        missed_double += !listed_double && expected;
        apart += listed != listed_double;
        ASSERT_TRUE(listed || !expected)
            << "case " << n << ": path " << c.displacement.x << "," << c.displacement.y;
      }
    }
  }
  const auto percent = [&](std::uint64_t count) {
    return 100.0 * static_cast<double>(count) / static_cast<double>(met);
  };
  std::cout << "tiles met " << met << ", extra " << percent(extra) << " % (in double "
            << percent(extra_double) << " %), float and double differ in " << percent(apart)
            << " %\n";
  EXPECT_EQ(missed, 0u);
  EXPECT_EQ(missed_double, 0u);
  EXPECT_LT(percent(extra), 2.0);
  EXPECT_LT(percent(apart), 0.5);
}

TEST(Trail, CoversEveryPixelOfEveryStepOfThePath) {
  RandomCases random;
  int touched = 0;
  for (int n = 0; n < 3000; ++n) {
    const Case c = random.next();
    const auto trail = trail_of<float>(c);
    const auto low = static_cast<float>(c.first_px.y);
    const auto high = low + static_cast<float>(tile - 1.0);
    const bool listed = lists(math::columns_in_band(trail, low, high), c.first_px.x);
    bool reached = false;
    for (int step = 0; step <= 8 && !reached; ++step)
      for (int y = 0; y < tile_size_px; ++y)
        for (int x = 0; x < tile_size_px; ++x) {
          const math::Whitening<double> w{c.w.xx, c.w.xy, c.w.yy};
          const math::Vec2<double> d{c.first_px.x + x - step / 8.0 * double(c.displacement.x),
                                     double(low) + y - step / 8.0 * double(c.displacement.y)};
          reached |= math::whitened_square(w, d) <= double(c.reach);
        }
    touched += reached;
    ASSERT_TRUE(listed || !reached) << "case " << n;
  }
  EXPECT_GT(touched, 300);
}

TEST(Trail, ATrailOfZeroLengthIsItsEllipse) {
  RandomCases random;
  for (int n = 0; n < 10000; ++n) {
    Case c = random.next();
    c.displacement = {0.0f, 0.0f};
    const auto trail = trail_of<double>(c);
    const double low = c.first_px.y, high = low + tile - 1.0;
    const auto columns = math::columns_in_band(trail, low, high);
    const auto expected = math::columns_in_band(trail.ellipse, low, high);
    ASSERT_EQ(columns.low <= columns.high, expected.low <= expected.high) << n;
    if (expected.low > expected.high) continue;
    const double width = 1.0 + expected.high - expected.low;
    EXPECT_NEAR(columns.low, expected.low, 2e-3 * width) << n;
    EXPECT_NEAR(columns.high, expected.high, 2e-3 * width) << n;
  }
}

TEST(Trail, OutlineHoldsBothEllipsesTightly) {
  RandomCases random;
  for (int n = 0; n < 2000; ++n) {
    const Case a = random.next(), b = random.next();
    const math::Whitening<double> first{a.w.xx, a.w.xy, a.w.yy}, second{b.w.xx, b.w.xy, b.w.yy};
    const auto both = math::whitening_of_both(first, second);
    const math::Whitening<float> rounded = math::whitening_of_both(a.w, b.w);
    // The largest squared distance on a rim, in units of the outline's.
    const auto farthest = [](const auto& rim, const math::Whitening<double>& outline) {
      double largest = 0.0;
      for (int step = 0; step < 4000; ++step) {
        const double angle = step * M_PI / 4000;
        const double y = std::sin(angle) / rim.yy, x = (std::cos(angle) - rim.xy * y) / rim.xx;
        largest = std::max(largest, math::whitened_square(outline, {x, y}));
      }
      return largest;
    };
    // Both are inside and one touches; and nothing is smaller, or the order would matter.
    EXPECT_LE(std::max(farthest(first, both), farthest(second, both)), 1.0 + 1e-9) << n;
    EXPECT_GE(std::max(farthest(first, both), farthest(second, both)), 1.0 - 1e-4) << n;
    const auto area = [](const auto& w) { return 1.0 / (w.xx * w.yy); };
    EXPECT_NEAR(area(math::whitening_of_both(second, first)), area(both), 1e-6 * area(both)) << n;
    EXPECT_NEAR(area(rounded), area(both), 1e-2 * area(both)) << n;
    const math::Whitening<double> widened{rounded.xx, rounded.xy, rounded.yy};
    EXPECT_LE(std::max(farthest(first, widened), farthest(second, widened)), 1.01) << n;
  }
}

TEST(Trail, OutlineOfAnEllipseInsideTheOtherIsTheOther) {
  const math::Whitening<double> large{0.1, 0.02, 0.05}, small{0.4, 0.02, 0.5};
  for (const auto& both :
       {math::whitening_of_both(large, small), math::whitening_of_both(small, large)}) {
    EXPECT_NEAR(both.xx, large.xx, 1e-12);
    EXPECT_NEAR(both.xy, large.xy, 1e-12);
    EXPECT_NEAR(both.yy, large.yy, 1e-12);
  }
}

TEST(Trail, PathsEndAtTheNearPlane) {
  const math::Vec3<double> inside{1.0, 2.0, 4.0};
  const auto stays = math::cut_at_near(inside, {3.0, 2.0, 1.5}, 1.0);
  EXPECT_EQ(stays.x, 3.0);
  EXPECT_EQ(stays.z, 1.5);
  const auto cut = math::cut_at_near(inside, {5.0, -2.0, 0.0}, 1.0);  // three quarters of the way
  EXPECT_DOUBLE_EQ(cut.x, 4.0);
  EXPECT_DOUBLE_EQ(cut.y, -1.0);
  EXPECT_DOUBLE_EQ(cut.z, 1.0);
}

}  // namespace
}  // namespace catgs

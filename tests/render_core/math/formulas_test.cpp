// Each formula against an independent way to the same number.

#include <cmath>
#include <random>

#include <glm/gtc/matrix_access.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/mat2x2.hpp>
#include <glm/mat3x3.hpp>
#include <gtest/gtest.h>

#include "render_core/math/blend-inl.h"
#include "render_core/math/camera-inl.h"
#include "render_core/math/ellipse-inl.h"
#include "render_core/math/projection-inl.h"
#include "render_core/math/spherical_harmonics-inl.h"

namespace catgs {
namespace {

struct RandomGaussian {
  glm::dvec3 mean;
  glm::dquat rotation;
  glm::dvec3 scale;
};

class Formulas : public testing::Test {
 protected:
  double uniform(double low, double high) {
    return std::uniform_real_distribution(low, high)(random_);
  }
  glm::dvec3 uniform3(double low, double high) {
    return {uniform(low, high), uniform(low, high), uniform(low, high)};
  }
  glm::dquat rotation() {
    return glm::normalize(
        glm::dquat(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)));
  }
  /// In front of the camera of `camera()`; axis ratios up to 1000.
  RandomGaussian gaussian() {
    const glm::dvec3 logs = uniform3(-3.0, 0.0);
    return {glm::dvec3(uniform(-2, 2), uniform(-1, 1), uniform(3, 9)),
            rotation(),
            {std::pow(10, logs.x), std::pow(10, logs.y), std::pow(10, logs.z)}};
  }
  static Camera camera() {
    Camera c = make_camera({}, {640, 360}, 500.0f);
    c.principal_point_px += glm::vec2(7.0f, -3.0f);
    return c;
  }

  static math::Vec3<double> vec3(const glm::dvec3& v) { return {v.x, v.y, v.z}; }
  static math::CovarianceFactor<double> factor(const RandomGaussian& g) {
    const double q[4] = {g.rotation.x, g.rotation.y, g.rotation.z, g.rotation.w};
    return math::covariance_factor(q, vec3(g.scale));
  }
  static glm::dmat3 covariance(const RandomGaussian& g) {
    const glm::dmat3 r = glm::mat3_cast(g.rotation);
    glm::dmat3 s2(0.0);
    for (int i = 0; i < 3; ++i) s2[i][i] = g.scale[i] * g.scale[i];
    return r * s2 * glm::transpose(r);
  }
  static glm::dvec2 pixel_of(const Camera& c, const glm::dvec3& p) {
    return glm::dvec2(p) / p.z * glm::dvec2(c.focal_px) + glm::dvec2(c.principal_point_px);
  }

  std::mt19937_64 random_{7};
};

TEST_F(Formulas, CovarianceFactorSquaresToCovariance) {
  for (int n = 0; n < 200; ++n) {
    const RandomGaussian g = gaussian();
    const auto l = factor(g);
    glm::dmat3 lower(0.0);  // glm is column-major: lower[column][row]
    lower[0] = {l.xx, l.yx, l.zx};
    lower[1] = {0.0, l.yy, l.zy};
    lower[2] = {0.0, 0.0, l.zz};
    const glm::dmat3 product = lower * glm::transpose(lower);
    const glm::dmat3 expected = covariance(g);
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j)
        EXPECT_NEAR(product[i][j], expected[i][j], 1e-14 + 1e-12 * glm::length(g.scale));
  }
}

TEST_F(Formulas, ProjectionIsLinearisedAtTheCentre) {
  const Camera c = camera();
  const auto model = math::make_camera_model(c);
  for (int n = 0; n < 200; ++n) {
    const RandomGaussian g = gaussian();
    const auto p =
        math::project(model, vec3(g.mean), factor(g), math::view_depth(model, vec3(g.mean)));
    const glm::dvec2 centre = pixel_of(c, g.mean);
    EXPECT_NEAR(p.centre_px.x, centre.x, 1e-9);
    EXPECT_NEAR(p.centre_px.y, centre.y, 1e-9);

    // The Jacobian by central differences (the Gaussians of this test are inside the fov clamp).
    const double h = 1e-5;
    glm::dmat3x2 jacobian;
    for (int axis = 0; axis < 3; ++axis) {
      glm::dvec3 step(0.0);
      step[axis] = h;
      jacobian[axis] = (pixel_of(c, g.mean + step) - pixel_of(c, g.mean - step)) / (2 * h);
    }
    glm::dmat2 sigma = jacobian * covariance(g) * glm::transpose(jacobian);
    EXPECT_NEAR(p.sharp_determinant, glm::determinant(sigma),
                1e-6 * (sigma[0][0] + sigma[1][1]) * (sigma[0][0] + sigma[1][1]));
    sigma[0][0] += low_pass_px2;
    sigma[1][1] += low_pass_px2;
    const double tolerance = 1e-6 * (sigma[0][0] + sigma[1][1]);
    EXPECT_NEAR(p.xx, sigma[0][0], tolerance);
    EXPECT_NEAR(p.xy, sigma[0][1], tolerance);
    EXPECT_NEAR(p.yy, sigma[1][1], tolerance);
    EXPECT_NEAR(p.determinant, glm::determinant(sigma), tolerance * (sigma[0][0] + sigma[1][1]));
  }
}

// The sum of alpha over the picture is 2 pi opacity sqrt(determinant).
TEST_F(Formulas, AntialiasingKeepsTheSumOfAGaussian) {
  const auto model = math::make_camera_model(camera());
  for (int n = 0; n < 200; ++n) {
    const RandomGaussian g = gaussian();
    const auto p = math::project(model, vec3(g.mean), factor(g), g.mean.z);
    const double opacity = uniform(0.01, 0.99);
    const double drawn = std::exp2(math::antialiased_log2_opacity(std::log2(opacity), p));
    EXPECT_NEAR(drawn * std::sqrt(p.determinant), opacity * std::sqrt(p.sharp_determinant),
                1e-9 * std::sqrt(p.determinant));
    EXPECT_LT(drawn, opacity);
  }
  // A Gaussian seen edge-on has no area, and is not infinitely faint.
  const math::ProjectedGaussian<double> edge{{0, 0}, 9.0, 0.0, 0.3, 2.7, 0.0};
  EXPECT_LT(math::reach_of(math::antialiased_log2_opacity(0.0, edge)), 0.0);
  EXPECT_TRUE(std::isfinite(math::antialiased_log2_opacity(0.0, edge)));
}

TEST_F(Formulas, FootprintIsClampedOutsideTheFieldOfView) {
  const Camera c = make_camera({}, {640, 360}, 500.0f);
  const auto model = math::make_camera_model(c);
  const RandomGaussian far_out{{40.0, 0.0, 4.0}, glm::dquat(1, 0, 0, 0), glm::dvec3(0.1)};
  const auto p = math::project(model, vec3(far_out.mean), factor(far_out), 4.0);
  const double slope = 1.3 * 320.0 / 500.0;  // instead of 10
  const double expected = std::pow(500.0 / 4.0 * 0.1, 2) * (1.0 + slope * slope) + low_pass_px2;
  EXPECT_NEAR(p.xx, expected, 1e-4 * expected);
  EXPECT_NEAR(p.centre_px.x, 320.0 + 500.0 * 10.0, 1e-9);  // the centre itself is not clamped
}

TEST_F(Formulas, WhiteningGivesTheExponentOfTheConic) {
  const auto model = math::make_camera_model(camera());
  for (int n = 0; n < 200; ++n) {
    const RandomGaussian g = gaussian();
    const auto p = math::project(model, vec3(g.mean), factor(g), g.mean.z);
    const auto w = math::whitening(p);
    const glm::dmat2 conic = glm::inverse(glm::dmat2(p.xx, p.xy, p.xy, p.yy));
    const double opacity = uniform(0.01, 0.99);
    const glm::dvec2 d(uniform(-30, 30), uniform(-30, 30));
    const double expected = opacity * std::exp(-0.5 * glm::dot(d, conic * d));
    const double exponent = std::log2(opacity) - math::whitened_square(w, {d.x, d.y});
    EXPECT_NEAR(std::exp2(exponent), expected, 1e-9);
  }
}

TEST_F(Formulas, NeedleKeepsItsWidthInSinglePrecision) {
  // A thousand pixels long, low-pass thin, at 45 degrees: the conic in float is noise here.
  const math::ProjectedGaussian<double> p{{0, 0},    5e5 + 0.3,         5e5,
                                          5e5 + 0.3, 0.3 * (1e6 + 0.3), 0.0};
  const math::ProjectedGaussian<float> f{{0, 0},      float(p.xx),          float(p.xy),
                                         float(p.yy), float(p.determinant), 0.0f};
  const auto wide = math::whitening(p);
  const auto narrow = math::whitening(f);
  for (const double along : {0.0, 100.0, 700.0})
    for (const double across : {0.0, 0.5, 1.0})
      EXPECT_NEAR(math::whitened_square(narrow, {float(along + across), float(along - across)}),
                  math::whitened_square(wide, {along + across, along - across}), 3e-3);
}

TEST_F(Formulas, HarmonicsHaveTheOriginalsOrderAndSigns) {
  // What no symmetric property shows: the original's table of constants, evaluated by hand in the
  // direction (0.48, 0.6, 0.64).
  const double expected[16] = {0.282094791774,  -0.293161507142, 0.312705607618,  -0.234529205713,
                               0.314653948011,  -0.419538597347, 0.072161590130,  -0.335630877878,
                               -0.070797138302, -0.117253462190, 0.532797501108,  -0.287390398703,
                               -0.227368875921, -0.229912318963, -0.119879437749, 0.240624496321};
  double basis[16];
  math::sh_basis<double>({0.48, 0.6, 0.64}, 3, basis);
  for (int i = 0; i < 16; ++i) EXPECT_NEAR(basis[i], expected[i], 1e-9) << i;
}

TEST_F(Formulas, HarmonicsAreOrthonormal) {
  // Integral over the sphere by a uniform grid in (z, azimuth), exact enough for degree 6 products.
  constexpr int rings = 800, steps = 64;
  double gram[16][16] = {};
  for (int i = 0; i < rings; ++i) {
    const double z = -1.0 + (2.0 * i + 1.0) / rings;
    const double r = std::sqrt(1.0 - z * z);
    for (int j = 0; j < steps; ++j) {
      const double azimuth = 2.0 * M_PI * j / steps;
      double basis[16];
      math::sh_basis<double>({r * std::cos(azimuth), r * std::sin(azimuth), z}, 3, basis);
      for (int a = 0; a < 16; ++a)
        for (int b = 0; b < 16; ++b)
          gram[a][b] += basis[a] * basis[b] * 4.0 * M_PI / (rings * steps);
    }
  }
  for (int a = 0; a < 16; ++a)
    for (int b = 0; b < 16; ++b) EXPECT_NEAR(gram[a][b], a == b ? 1.0 : 0.0, 2e-4) << a << " " << b;
}

TEST_F(Formulas, BlendFollowsTheDefinition) {
  for (int n = 0; n < 200; ++n) {
    auto pixel = math::empty_pixel<double>();
    double transmittance = 1.0, red = 0.0;
    for (int i = 0; i < 40; ++i) {
      const double exponent = uniform(-9.0, -0.02), colour = uniform(0.0, 2.0);
      math::blend(pixel, exponent, {colour, 0.0, 0.0});
      const double alpha = std::exp2(exponent);
      if (alpha < 1.0 / 255.0) continue;
      if (transmittance * (1.0 - alpha) < 1e-4) break;
      red += transmittance * alpha * colour;
      transmittance *= 1.0 - alpha;
    }
    // Past its end a pixel ignores everything.
    for (int i = 0; i < 5; ++i)
      if (pixel.transmittance < 0) math::blend(pixel, 0.0, {1.0, 0.0, 0.0});
    EXPECT_NEAR(pixel.colour.x, red, 1e-12);
    EXPECT_NEAR(std::abs(pixel.transmittance), transmittance, 1e-12);
  }
}

TEST_F(Formulas, NothingIsFullyOpaque) {
  auto pixel = math::empty_pixel<double>();
  math::blend(pixel, 0.0, {1.0, 0.0, 0.0});
  EXPECT_DOUBLE_EQ(pixel.colour.x, 0.99);
}

}  // namespace
}  // namespace catgs

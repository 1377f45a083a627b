#include "render_core/scene/transform.h"

#include <glm/gtc/quaternion.hpp>
#include <glm/matrix.hpp>

#include "render_core/math/spherical_harmonics-inl.h"
#include "tests/render_core/scene/scene_test_support.h"

namespace catgs::test {
namespace {

const glm::dmat3 any_rotation(glm::mat3_cast(glm::normalize(glm::dquat(0.3, -0.5, 0.7, 0.2))));
const glm::dmat3 stretch(2.0, 0.3, -0.1, 0.2, 0.5, 0.4, 0.0, 0.1, 1.5);

GaussianCloud transformed(GaussianCloud cloud, const AffineMap& map) {
  const CloudTransform transform(map);
  for (std::size_t i = 0; i < cloud.size(); ++i) transform.apply(cloud, i);
  return cloud;
}

glm::dmat3 covariance(const GaussianCloud& cloud, std::size_t i) {
  const glm::dmat3 axes = glm::mat3_cast(glm::normalize(glm::dquat(cloud.rotation[i])));
  const glm::dvec3 s(cloud.scale[i]);
  const glm::dmat3 scaled(axes[0] * s.x, axes[1] * s.y, axes[2] * s.z);
  return scaled * glm::transpose(scaled);
}

glm::vec3 colour(const GaussianCloud& cloud, std::size_t i, const glm::dvec3& direction) {
  double basis[16];
  math::sh_basis<double>({direction.x, direction.y, direction.z}, cloud.sh_degree, basis);
  glm::dvec3 sum(0.5);
  for (int k = 0; k < cloud.sh_count(); ++k) sum += basis[k] * glm::dvec3(cloud.sh_of(i)[k]);
  return glm::vec3(sum);
}

void expect_equal_but_for_rounding(const glm::dmat3& a, const glm::dmat3& b, double scale) {
  for (int c = 0; c < 3; ++c)
    for (int r = 0; r < 3; ++r) EXPECT_NEAR(a[c][r], b[c][r], 2e-6 * scale);
}

class Transform : public ::testing::TestWithParam<glm::dmat3> {};

TEST_P(Transform, MeansAndCovariancesFollowTheMap) {
  const AffineMap map{GetParam(), {1.0, -2.0, 3.0}};
  const GaussianCloud before = random_cloud(200, 0), after = transformed(before, map);
  for (std::size_t i = 0; i < before.size(); ++i) {
    EXPECT_LT(glm::distance(glm::dvec3(after.mean[i]), map(glm::dvec3(before.mean[i]))), 1e-5);
    const glm::dmat3 wanted = map.linear * covariance(before, i) * glm::transpose(map.linear);
    expect_equal_but_for_rounding(covariance(after, i), wanted,
                                  wanted[0][0] + wanted[1][1] + wanted[2][2]);
    EXPECT_NEAR(glm::length(after.rotation[i]), 1.0f, 1e-6f);
  }
}

INSTANTIATE_TEST_SUITE_P(Scene, Transform,
                         ::testing::Values(glm::dmat3(1.0), glm::dmat3(3.0), any_rotation,
                                           0.01 * any_rotation, -2.0 * any_rotation, stretch,
                                           stretch* any_rotation, -1.0 * stretch));

TEST(CloudTransformTest, ColoursTurnWithTheScene) {
  for (const glm::dmat3& turn : {any_rotation, -any_rotation, glm::dmat3(1.0)}) {
    const GaussianCloud before = random_cloud(20, 3), after = transformed(before, {turn, {}});
    for (std::size_t i = 0; i < before.size(); ++i)
      for (const glm::dvec3& d : {glm::dvec3(1, 0, 0), glm::normalize(glm::dvec3(1, -2, 3))})
        EXPECT_LT(glm::distance(colour(before, i, d), colour(after, i, turn * d)), 2e-6f);
  }
}

TEST(CloudTransformTest, AStretchTurnsColoursByItsRotationAlone) {
  const glm::dmat3 along_axes(2.0, 0, 0, 0, 0.1, 0, 0, 0, 1.0);
  const GaussianCloud before = random_cloud(20, 3);
  const GaussianCloud after = transformed(before, {any_rotation * along_axes, {}});
  const GaussianCloud turned = transformed(before, {any_rotation, {}});
  for (std::size_t k = 0; k < before.sh.size(); ++k)
    EXPECT_LT(glm::distance(after.sh[k], turned.sh[k]), 1e-6f);
}

TEST(CloudTransformTest, AHalfTurnTwiceIsNothingBitForBit) {
  const AffineMap half_turn{glm::dmat3(-1, 0, 0, 0, -1, 0, 0, 0, 1), {}};
  const GaussianCloud before = random_cloud(100, 3);
  const GaussianCloud after = transformed(transformed(before, half_turn), half_turn);
  for (std::size_t i = 0; i < before.size(); ++i) {
    EXPECT_EQ(after.mean[i], before.mean[i]);
    EXPECT_EQ(after.scale[i], before.scale[i]);
    EXPECT_EQ(after.rotation[i], -before.rotation[i]);  // the same rotation
  }
  EXPECT_EQ(after.sh, before.sh);
}

TEST(CloudTransformTest, VeryFlatGaussiansStayFlat) {
  GaussianCloud cloud = random_cloud(50, 0);
  for (glm::vec3& scale : cloud.scale) scale = {1.0f, 0.5f, 1e-8f};
  const GaussianCloud after = transformed(cloud, {stretch, {}});
  const double volume = glm::determinant(stretch) * 0.5e-8;
  for (const glm::vec3& s : after.scale)
    EXPECT_NEAR(double{s.x} * s.y * s.z, volume, 1e-5 * volume);
}

TEST(CloudTransformTest, NonFiniteValuesAreLeftToTheSanitizer) {
  GaussianCloud cloud = random_cloud(3, 1);
  cloud.rotation[0] = glm::quat(0.0f, 0.0f, 0.0f, 0.0f);
  cloud.rotation[1].x = std::nanf("");
  cloud.scale[2] = glm::vec3(0.0f);
  const GaussianCloud after = transformed(cloud, {stretch, {}});
  EXPECT_EQ(after.rotation[0], cloud.rotation[0]);
  EXPECT_TRUE(std::isnan(after.rotation[1].x));
  for (int k = 0; k < 3; ++k) EXPECT_LT(after.scale[2][k], 1e-20f);
}

TEST(AffineMapTest, InvertibleMapsAreUsable) {
  EXPECT_TRUE((AffineMap{1e-6 * stretch, {1e9, 0, 0}}).usable());
  EXPECT_FALSE((AffineMap{glm::dmat3(1, 0, 0, 2, 0, 0, 0, 0, 1), {}}).usable());
  EXPECT_FALSE((AffineMap{glm::dmat3(0.0), {}}).usable());
  EXPECT_FALSE((AffineMap{glm::dmat3(1.0), {NAN, 0, 0}}).usable());
}

}  // namespace
}  // namespace catgs::test

#include "render_core/scene/files/sanitize.h"

#include <cmath>
#include <limits>

#include "render_core/scene/transform.h"
#include "tests/render_core/scene/scene_test_support.h"

namespace catgs::test {
namespace {

constexpr float nan = std::numeric_limits<float>::quiet_NaN();
constexpr float infinity = std::numeric_limits<float>::infinity();

TEST(Sanitize, SoundCloudsPassUntouched) {
  GaussianCloud cloud = random_cloud(10000, 2);
  const GaussianCloud before = cloud;
  const SanitizeReport report = sanitize(cloud, two_threads());
  EXPECT_EQ(report.read, 10000u);
  EXPECT_EQ(report.dropped, 0u);
  EXPECT_EQ(report.repaired, 0u);
  EXPECT_EQ(cloud.mean, before.mean);
  EXPECT_EQ(cloud.sh, before.sh);
}

TEST(Sanitize, SurfelsAreFlatAndSound) {
  GaussianCloud cloud = random_cloud(100, 0);
  const GaussianCloud before = cloud;
  flatten(cloud);
  EXPECT_EQ(sanitize(cloud, two_threads()).repaired, 0u);
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    EXPECT_EQ(cloud.scale[i].x, before.scale[i].x);
    EXPECT_NEAR(cloud.scale[i].z, 1e-3f * std::min(before.scale[i].x, before.scale[i].y), 1e-6f);
  }
}

TEST(Sanitize, UndrawableGaussiansAreDroppedAndTheOrderStays) {
  GaussianCloud cloud = random_cloud(10000, 1);
  const GaussianCloud before = cloud;
  cloud.mean[10].y = nan;
  cloud.scale[11].z = infinity;
  cloud.rotation[12].w = nan;
  cloud.opacity[13] = nan;
  cloud.opacity[14] = 0.0f;
  cloud.opacity[15] = 0.0039f;  // just under 1/255
  cloud.mean[16].x = 1e7f;
  cloud.scale[17].x = 1e7f;
  cloud.mean[9000].z = 3e9f;
  const SanitizeReport report = sanitize(cloud, two_threads());
  EXPECT_EQ(report.not_finite, 4u);
  EXPECT_EQ(report.invisible, 2u);
  EXPECT_EQ(report.absurd, 3u);
  EXPECT_EQ(report.dropped, 9u);
  ASSERT_EQ(cloud.size(), 9991u);
  EXPECT_EQ(cloud.sh.size(), 9991u * 4);
  EXPECT_EQ(cloud.mean[9], before.mean[9]);
  EXPECT_EQ(cloud.mean[10], before.mean[18]);
  EXPECT_EQ(cloud.sh_of(10)[3], before.sh_of(18)[3]);
  EXPECT_EQ(cloud.mean[8991], before.mean[8999]);
  EXPECT_EQ(cloud.mean[8992], before.mean[9001]);
}

TEST(Sanitize, FaintestGaussiansSurviveWriting) {
  GaussianCloud cloud = test::random_cloud(2, 0, 1);
  const float faintest = 1.0f / 255.0f;
  cloud.opacity = {faintest * (1.0f - 3e-6f), 0.999f * faintest};
  EXPECT_EQ(sanitize(cloud, two_threads()).invisible, 1u);
  ASSERT_EQ(cloud.size(), 1u);
  EXPECT_EQ(cloud.opacity[0], faintest);
}

TEST(Sanitize, ValuesOfObviousMeaningAreRepaired) {
  GaussianCloud cloud = random_cloud(1000, 1);
  cloud.rotation[1] = glm::quat(0.0f, 0.0f, 0.0f, 0.0f);
  cloud.rotation[2] = glm::quat(1e-30f, 0.0f, 0.0f, -1e-30f);
  cloud.rotation[3] = glm::quat(0.0f, 3e30f, 0.0f, 0.0f);
  cloud.scale[4].y = 0.0f;
  cloud.opacity[5] = 1.0f;
  cloud.sh[6 * 4 + 2].g = nan;
  cloud.sh[6 * 4 + 3].b = infinity;
  cloud.scale[6].x = 1e-20f;
  const SanitizeReport report = sanitize(cloud, two_threads());
  EXPECT_EQ(report.dropped, 0u);
  EXPECT_EQ(report.zero_rotations, 1u);
  EXPECT_EQ(report.clamped, 3u);
  EXPECT_EQ(report.zeroed_sh, 1u);
  EXPECT_EQ(report.repaired, 4u);
  EXPECT_EQ(cloud.rotation[1], glm::quat(1.0f, 0.0f, 0.0f, 0.0f));
  EXPECT_NEAR(cloud.rotation[2].w, std::sqrt(0.5f), 1e-6f);
  EXPECT_NEAR(cloud.rotation[2].z, -std::sqrt(0.5f), 1e-6f);
  EXPECT_NEAR(cloud.rotation[3].x, 1.0f, 1e-6f);
  EXPECT_GT(cloud.scale[4].y, 0.0f);
  EXPECT_LT(cloud.opacity[5], 1.0f);
  EXPECT_EQ(cloud.sh[6 * 4 + 2].g, 0.0f);
  EXPECT_EQ(cloud.sh[6 * 4 + 3].b, 0.0f);
}

TEST(Sanitize, InvariantsHoldAfterRandomBytes) {
  GaussianCloud cloud;
  cloud.resize(20000, 1);
  std::mt19937 random(3);
  const auto scramble = [&](auto& values) {
    auto* words = reinterpret_cast<std::uint32_t*>(values.data());
    for (std::size_t i = 0; i < values.size() * sizeof(values[0]) / 4; ++i)
      words[i] = static_cast<std::uint32_t>(random());
  };
  scramble(cloud.mean);
  scramble(cloud.rotation);
  scramble(cloud.scale);
  scramble(cloud.opacity);
  scramble(cloud.sh);
  const SanitizeReport report = sanitize(cloud, two_threads());
  EXPECT_EQ(report.read, cloud.size() + report.dropped);
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    EXPECT_TRUE(std::isfinite(glm::dot(cloud.mean[i], cloud.mean[i])));
    EXPECT_NEAR(glm::length(cloud.rotation[i]), 1.0f, 1e-5f);
    EXPECT_GT(cloud.opacity[i], 0.0f);
    EXPECT_LT(cloud.opacity[i], 1.0f);
    for (int k = 0; k < 3; ++k) {
      EXPECT_GT(cloud.scale[i][k], 0.0f);
      EXPECT_TRUE(std::isfinite(cloud.scale[i][k]));
    }
  }
  for (const glm::vec3& c : cloud.sh)
    for (int k = 0; k < 3; ++k) EXPECT_TRUE(std::isfinite(c[k]));
}

TEST(Sanitize, CoincidentGaussiansDoNotMakeTheRestAbsurd) {
  GaussianCloud cloud = random_cloud(1000, 0);
  for (std::size_t i = 0; i < 995; ++i) cloud.mean[i] = glm::vec3(1.0f, 2.0f, 3.0f);
  EXPECT_EQ(sanitize(cloud, two_threads()).dropped, 0u);
}

}  // namespace
}  // namespace catgs::test

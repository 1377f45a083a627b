#include "render_core/scene/edit/merge_gaussians.h"

#include <memory>
#include <vector>

#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>

#include "render_core/reference/reference.h"
#include "render_core/scene/prune.h"
#include "tests/render_core/scene/scene_test_support.h"
#include "tests/support/picked.h"
#include "tests/support/rendered.h"
#include "tests/support/test_scenes.h"

namespace catgs::test {
namespace {

GaussianCloud merged(GaussianCloud cloud, std::size_t wanted, int threads = 2) {
  ThreadPool pool(threads);
  merge_gaussians(cloud, wanted, pool, LoadContext(pool));
  return cloud;
}

/// Sums over a scene of w = opacity x RMS projected area, of w mean, w SH, and of the second
/// moments w (Sigma + mean mean^T).
struct Moments {
  double weight = 0.0;
  glm::dvec3 mean{0.0}, base{0.0}, last{0.0};
  glm::dmat3 second{0.0};
};

Moments moments_of(const GaussianCloud& cloud) {
  Moments sums;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const glm::dvec3 s = glm::dvec3(cloud.scale[i]) * glm::dvec3(cloud.scale[i]);
    const double weight = cloud.opacity[i] * std::sqrt((s.x * s.y + s.y * s.z + s.z * s.x) / 3.0);
    const glm::dmat3 turn = glm::mat3_cast(glm::normalize(glm::dquat(cloud.rotation[i])));
    const glm::dmat3 spread(turn[0] * s.x, turn[1] * s.y, turn[2] * s.z);
    const glm::dvec3 mean(cloud.mean[i]);
    sums.weight += weight;
    sums.mean += weight * mean;
    sums.base += weight * glm::dvec3(cloud.sh_of(i)[0]);
    sums.last += weight * glm::dvec3(cloud.sh_of(i)[cloud.sh_count() - 1]);
    sums.second += weight * (spread * glm::transpose(turn) + glm::outerProduct(mean, mean));
  }
  return sums;
}

TEST(MergeGaussians, TotalMomentsAndTheWantedCountAreKept) {
  GaussianCloud cloud = random_cloud(3000, 2);
  for (std::size_t i = 0; i < cloud.size(); ++i) {  // neither end of the range of opacities is met
    cloud.mean[i] *= 0.05f;
    cloud.scale[i] = {0.1f, 0.08f, 0.12f};
    cloud.opacity[i] = 0.008f + 0.008f * cloud.opacity[i];
  }
  for (const std::size_t wanted : {2999u, 1500u, 300u}) {
    const GaussianCloud after = merged(cloud, wanted);
    ASSERT_EQ(after.size(), wanted);
    ASSERT_TRUE(after.sizes_agree());
    const Moments a = moments_of(cloud), b = moments_of(after);
    EXPECT_NEAR(a.weight, b.weight, 1e-4 * a.weight);
    for (int k = 0; k < 3; ++k) {
      EXPECT_NEAR(a.mean[k], b.mean[k], 1e-4 * a.weight);
      EXPECT_NEAR(a.base[k], b.base[k], 1e-4 * a.weight);
      EXPECT_NEAR(a.last[k], b.last[k], 1e-4 * a.weight);
      for (int r = 0; r < 3; ++r) EXPECT_NEAR(a.second[k][r], b.second[k][r], 1e-3 * a.weight);
    }
    for (std::size_t i = 0; i < after.size(); ++i) {
      EXPECT_NEAR(glm::length(after.rotation[i]), 1.0f, 1e-5f);
      EXPECT_TRUE(after.opacity[i] > 0.0f && after.opacity[i] < 1.0f);
    }
  }
}

TEST(MergeGaussians, ResultsAreTheSameForAnyNumberOfThreads) {
  const GaussianCloud cloud = random_cloud(20'000, 1);
  const GaussianCloud one = merged(cloud, 5000, 1), three = merged(cloud, 5000, 3);
  EXPECT_EQ(ply_bytes(one), ply_bytes(three));
}

TEST(MergeGaussians, FewerGaussiansAreLeftAlone) {
  const GaussianCloud cloud = random_cloud(10, 1);
  EXPECT_EQ(ply_bytes(merged(cloud, 10)), ply_bytes(cloud));
  EXPECT_EQ(ply_bytes(merged(cloud, 11)), ply_bytes(cloud));
}

TEST(MergeGaussians, IndistinguishableGaussiansAreMerged) {
  GaussianCloud cloud = random_cloud(200, 0);
  for (float& opacity : cloud.opacity) opacity *= 0.4f;
  std::vector<std::uint32_t> twice(400);
  for (std::uint32_t i = 0; i < 400; ++i) twice[i] = i % 200;
  cloud = picked(cloud, twice);
  const GaussianCloud after = merged(cloud, 200);
  for (std::size_t i = 0; i < 200; ++i) {
    EXPECT_LT(glm::distance(after.mean[i], cloud.mean[i]), 1e-5f);
    EXPECT_NEAR(after.opacity[i], 2.0f * cloud.opacity[i], 1e-5f);
  }
}

TEST(MergeGaussians, MergingEndsForAnyValues) {
  GaussianCloud cloud = random_cloud(500, 0);
  for (std::size_t i = 0; i < 500; ++i) {
    cloud.mean[i] *= i % 3 == 0 ? 1e8f : 0.0f;
    cloud.scale[i] = i % 2 == 0 ? glm::vec3(1e9f, 1e-10f, 1e-10f) : glm::vec3(1e-10f);
  }
  const GaussianCloud after = merged(cloud, 1);
  ASSERT_EQ(after.size(), 1u);
  EXPECT_TRUE(std::isfinite(after.mean[0].x) && std::isfinite(after.scale[0].x));
  EXPECT_TRUE(std::isfinite(after.rotation[0].w) && after.scale[0].z > 0.0f);
}

/// A wall with a pattern, of small splats in the patterned half and of as many in the plain one.
GaussianCloud wall() {
  GaussianCloud cloud = random_cloud(6000, 0, 5u);
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    glm::vec3& mean = cloud.mean[i];
    mean = {std::remainder(mean.x, 2.0f), std::remainder(mean.y, 2.0f), 5.0f + 0.002f * mean.z};
    cloud.scale[i] = glm::vec3(0.04f, 0.04f, 0.002f);
    cloud.rotation[i] = glm::quat(1, 0, 0, 0);
    cloud.sh[i] = mean.x > 0.0f ? glm::vec3(0.5f)
                                : glm::vec3(std::sin(9.0f * mean.x), std::cos(7.0f * mean.y), 0);
  }
  return cloud;
}

TEST(MergeGaussians, MergingBeatsDropping) {
  const auto pool = std::make_shared<ThreadPool>(2);
  const auto draw = [&](const GaussianCloud& cloud) {
    const auto view =
        make_reference_renderer(std::make_shared<const GaussianCloud>(cloud), pool)->make_view({});
    return render_in(*view, {.camera = make_camera({glm::vec3(0.3f, 0.2f, 2.0f), {1, 0, 0, 0}},
                                                   {64, 64}, 80.0f)})
        .rgb;
  };
  const GaussianCloud cloud = wall();
  const auto whole = draw(cloud);
  for (const double share : {0.5, 0.25, 0.1}) {
    GaussianCloud dropped = cloud;
    keep_most_important(dropped, share);
    const double by_merging = psnr_db(whole, draw(merged(cloud, dropped.size())));
    EXPECT_GT(by_merging, psnr_db(whole, draw(dropped)) + 3.0) << share;
  }
}

}  // namespace
}  // namespace catgs::test

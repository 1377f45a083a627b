#include "render_core/scene/clusters.h"
#include "render_core/scene/formats/sog.h"
#include "tests/render_core/scene/scene_test_support.h"
#include "tests/support/picked.h"

namespace catgs::test {
namespace {

std::string written(const GaussianCloud& cloud, int threads = 2) {
  ThreadPool pool(threads);
  std::ostringstream out;
  write_sog(cloud, pool, out);
  return out.str();
}

GaussianCloud parse(const std::string& archive) {
  return read_sog(ZipFiles(MemorySource("scene.sog", bytes_of(archive))), "meta.json",
                  two_threads())
      .cloud;
}

/// The Gaussians in the order of the file: along a Morton curve.
GaussianCloud as_stored(const GaussianCloud& cloud) {
  ThreadPool pool(2);
  return picked(cloud, morton_order(cloud.mean, pool));
}

// A codebook's steps are widest where values are rare.
constexpr Tolerance steps = {.mean = 0.0008f,  // 1/131070 of the range of logarithms, at 15 units
                             .log_scale = 0.1f,
                             .rotation_rad = smallest_three_angle(0.5f * 1.41422f / 255),
                             .opacity = 0.00197f,
                             .sh0 = 0.01f,
                             .sh1 = 0.05f,
                             .sh_rest = 0.05f};

TEST(SogWriter, RoundTripErrorsAreThoseStated) {
  for (const int degree : {0, 1, 2, 3}) {
    SCOPED_TRACE(degree);
    const GaussianCloud cloud = random_cloud(20'000, degree);
    expect_near(as_stored(cloud), parse(written(cloud)), steps);
  }
}

TEST(SogWriter, HarmonicsOfLargeScenesAreAPalette) {
  GaussianCloud cloud = random_cloud(70'000, 1);
  const std::size_t kinds = 1000;
  for (std::size_t i = kinds; i < cloud.size(); ++i)
    for (std::size_t k = 1; k < 4; ++k) cloud.sh[4 * i + k] = cloud.sh[4 * (i % kinds) + k];
  Tolerance tolerance = steps;
  tolerance.mean = 0.001f;
  expect_near(as_stored(cloud), parse(written(cloud)), tolerance);
}

TEST(SogWriter, BytesDependOnTheSceneAlone) {
  const GaussianCloud cloud = random_cloud(3000, 2);
  EXPECT_EQ(written(cloud, 1), written(cloud, 4));
}

TEST(SogWriter, SmallAndFlatScenesAreWritten) {
  for (const std::size_t count : {1, 2, 3, 300}) {
    GaussianCloud cloud = random_cloud(count, 3);
    for (glm::vec3& mean : cloud.mean) mean.y = 7.0f;
    const GaussianCloud read = parse(written(cloud));
    ASSERT_EQ(read.size(), count);
    for (const glm::vec3& mean : read.mean) EXPECT_NEAR(mean.y, 7.0f, 1e-5f);
  }
}

TEST(SogWriter, EachModelIsWrittenAndReadAgain) {
  GaussianCloud cloud = random_cloud(100, 0);
  for (const SplatModel model :
       {SplatModel::standard, SplatModel::antialiased, SplatModel::surfels}) {
    cloud.model = model;
    EXPECT_EQ(parse(written(cloud)).model, model);
  }
}

TEST(SogWriter, LossesAreTold) {
  GaussianCloud cloud = random_cloud(300, 0);
  EXPECT_TRUE(sog_losses(cloud).empty());
  for (std::size_t i = 0; i < 150; ++i) cloud.mean[i] += 500'000.0f;
  for (glm::vec3& scale : cloud.scale) scale = glm::vec3(0.05f);
  EXPECT_THAT(sog_losses(cloud), testing::ElementsAre(testing::HasSubstr("150 of 300 Gaussians")));
}

}  // namespace
}  // namespace catgs::test

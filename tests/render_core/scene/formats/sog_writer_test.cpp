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

/// RMS errors of all Gaussians but one.
struct Errors {
  double mean = 0.0, log_scale = 0.0, sh0 = 0.0, sh = 0.0;
};

Errors errors_of(const GaussianCloud& cloud, std::uint32_t but) {
  ThreadPool pool(2);
  const std::vector<std::uint32_t> order = morton_order(cloud.mean, pool);
  const GaussianCloud read = parse(written(cloud));
  Errors errors;
  const auto add = [](double& sum, const glm::vec3& a, const glm::vec3& b) {
    sum += double{glm::dot(a - b, a - b)};
  };
  for (std::uint32_t i = 0; i < order.size(); ++i) {
    const std::uint32_t of = order[i];
    if (of == but) continue;
    add(errors.mean, read.mean[i], cloud.mean[of]);
    add(errors.log_scale, glm::log(read.scale[i]), glm::log(cloud.scale[of]));
    add(errors.sh0, read.sh_of(i)[0], cloud.sh_of(of)[0]);
    for (int k = 1; k < cloud.sh_count(); ++k) add(errors.sh, read.sh_of(i)[k], cloud.sh_of(of)[k]);
  }
  return {std::sqrt(errors.mean), std::sqrt(errors.log_scale), std::sqrt(errors.sh0),
          std::sqrt(errors.sh)};
}

TEST(SogWriter, AWildGaussianCostsTheOthersNothing) {
  constexpr std::uint32_t wild = 100;
  for (const std::size_t count : {257u, 70'000u}) {
    GaussianCloud calm = random_cloud(count, 1);
    for (std::size_t i = 0; i < count; ++i) {  // of a size that 16 bits are just enough for
      calm.mean[i] *= 0.05f;
      calm.scale[i] *= 0.005f;
    }
    const Errors before = errors_of(calm, wild);
    using Change = void (*)(GaussianCloud & cloud);
    for (const Change change :
         std::initializer_list<Change>{[](GaussianCloud& c) {
                                         c.mean[wild] = {1e4f, -2e5f, 3.0f};
                                       },
                                       [](GaussianCloud& c) {
                                         c.scale[wild] = {1e6f, 1e-9f, 3.0f};
                                       },
                                       [](GaussianCloud& c) {
                                         c.sh[wild * 4] = {300.0f, -1000.0f, 0.0f};
                                       },
                                       [](GaussianCloud& c) {
                                         c.sh[wild * 4 + 2] = {300.0f, -1000.0f, 0.0f};
                                       }}) {
      GaussianCloud cloud = calm;
      change(cloud);
      const Errors after = errors_of(cloud, wild);
      EXPECT_LT(after.mean, 1.1 * before.mean);
      EXPECT_LT(after.log_scale, 1.1 * before.log_scale);
      EXPECT_LT(after.sh0, 1.1 * before.sh0);
      EXPECT_LT(after.sh, 1.1 * before.sh);
    }
  }
}

// Seen from the others, it is where it was and as large as it was.
TEST(SogWriter, AFarGaussianIsBroughtNearer) {
  constexpr std::uint32_t far = 100;
  GaussianCloud cloud = random_cloud(1000, 0);
  for (std::size_t i = 0; i < 500; ++i) {
    cloud.mean[i] = 0.01f * (cloud.mean[i] - glm::vec3(0, 0, 5));
    cloud.mean[500 + i] = -cloud.mean[i];
  }
  for (glm::vec3& scale : cloud.scale) scale = glm::vec3(1e-5f);
  cloud.mean[far] = glm::vec3(6e4f, 0.0f, 8e4f);
  cloud.scale[far] = glm::vec3(2e3f);
  const GaussianCloud read = parse(written(cloud));
  const auto at = std::ranges::max_element(read.scale, {}, [](const auto& s) { return s.x; });
  const auto i = static_cast<std::size_t>(at - read.scale.begin());
  EXPECT_LT(glm::length(read.mean[i]), 0.2f);
  EXPECT_NEAR(glm::dot(glm::normalize(read.mean[i]), glm::vec3(0.6f, 0.0f, 0.8f)), 1.0f, 0.02f);
  EXPECT_NEAR(read.scale[i].x / glm::length(read.mean[i]), 0.02f, 0.004f);
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

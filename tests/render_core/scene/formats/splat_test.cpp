#include "render_core/scene/formats/splat.h"

#include "render_core/scene/formats/scene_format.h"
#include "tests/render_core/scene/scene_test_support.h"

namespace catgs::test {
namespace {

GaussianCloud parse(const std::string& bytes) {
  return read_splat(MemorySource("scene.splat", bytes_of(bytes)), two_threads());
}

TEST(Splat, RoundTripKeepsWhatTheBytesCanHold) {
  GaussianCloud cloud = random_cloud(20000, 0);
  for (glm::vec3& sh : cloud.sh) sh = glm::clamp(sh, -1.77f, 1.77f);  // colours in [0, 1]
  std::ostringstream out;
  write_splat(cloud, out);
  ASSERT_EQ(out.str().size(), 32u * 20000);
  const GaussianCloud read = parse(out.str());
  EXPECT_EQ(read.mean, cloud.mean);
  EXPECT_EQ(read.scale, cloud.scale);
  expect_near(cloud, read, {.rotation_rad = 0.0157f, .opacity = 0.00197f, .sh0 = 0.00696f});
}

TEST(Splat, ViewDependenceIsLeftOut) {
  const GaussianCloud cloud = random_cloud(10, 3);
  std::ostringstream out;
  write_splat(cloud, out);
  EXPECT_EQ(parse(out.str()).sh_degree, 0);
}

TEST(Splat, DocumentedBytesAreRead) {
  std::string row;
  for (const float v : {1.0f, -2.0f, 3.0f, 0.5f, 0.25f, 0.125f}) append(row, v);
  for (const int byte : {255, 0, 51, 102}) row.push_back(static_cast<char>(byte));
  for (const int byte : {128, 255, 128, 128}) row.push_back(static_cast<char>(byte));
  const GaussianCloud read = parse(row);
  EXPECT_EQ(read.mean[0], glm::vec3(1, -2, 3));
  EXPECT_EQ(read.scale[0], glm::vec3(0.5f, 0.25f, 0.125f));
  EXPECT_NEAR(read.sh[0].r, 0.5 / 0.28209479, 1e-5);
  EXPECT_NEAR(read.sh[0].g, -0.5 / 0.28209479, 1e-5);
  EXPECT_NEAR(read.sh[0].b, -0.3 / 0.28209479, 1e-5);
  EXPECT_NEAR(read.opacity[0], 0.4f, 1e-6f);
  EXPECT_NEAR(read.rotation[0].x, 1.0f, 1e-6f);
}

TEST(Splat, OddSizesAreRefused) {
  EXPECT_EQ(
      input_error([] { parse(std::string(33, 'x')); }),
      "scene.splat: byte 33: the size of a .splat file is a multiple of 32 bytes (the file is "
      "cut off or of another format)");
  EXPECT_EQ(refusal_of([] { parse(""); }), (Refusal{"scene.splat", ""}));
}

TEST(Splat, LossesAreTold) {
  using ::testing::ElementsAre;
  using ::testing::HasSubstr;
  GaussianCloud cloud = random_cloud(300, 0);
  for (glm::vec3& sh : cloud.sh) sh = glm::vec3(0.5f);
  EXPECT_TRUE(splat_format.losses(cloud).empty());
  cloud.sh[7].y = 2.0f;
  cloud.sh[8].z = -2.0f;
  EXPECT_THAT(splat_format.losses(cloud),
              ElementsAre(HasSubstr("2 of 300 Gaussians have colours outside of 0…1")));
  EXPECT_THAT(splat_format.losses(random_cloud(300, 1)), testing::Contains(HasSubstr("harmonics")));
}

}  // namespace
}  // namespace catgs::test

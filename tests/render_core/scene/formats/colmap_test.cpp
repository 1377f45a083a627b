// COLMAP reconstructions, binary and text.
#include "render_core/scene/formats/colmap.h"

#include <cmath>
#include <cstdint>
#include <fstream>
#include <string>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "render_core/base/error.h"
#include "tests/support/temporary_folder.h"

namespace catgs {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

class Bytes {
 public:
  template <class T>
  Bytes& add(T value) {
    bytes_.append(reinterpret_cast<const char*>(&value), sizeof value);
    return *this;
  }
  Bytes& name(const std::string& text) {
    bytes_.append(text.c_str(), text.size() + 1);
    return *this;
  }
  [[nodiscard]] const std::string& text() const { return bytes_; }

 private:
  std::string bytes_;
};

void write(const std::filesystem::path& path, const std::string& content) {
  std::ofstream(path, std::ios::binary) << content;
}

std::string cameras_bin(int model = 1) {
  Bytes bytes;
  bytes.add<std::uint64_t>(1).add<std::uint32_t>(5).add<std::int32_t>(model);
  bytes.add<std::uint64_t>(640).add<std::uint64_t>(480);
  for (const double p : {500.0, 510.0, 321.0, 239.0}) bytes.add(p);
  return bytes.text();
}

/// A camera at (1, 2, 3) turned by 90 degrees about z, and one at the origin.
std::string images_bin() {
  const double h = std::sqrt(0.5);
  Bytes bytes;
  bytes.add<std::uint64_t>(2).add<std::uint32_t>(1);
  // camera_from_world turns x to y; t = -R (1, 2, 3) = (2, -1, -3).
  for (const double p : {h, 0.0, 0.0, h, 2.0, -1.0, -3.0}) bytes.add(p);
  bytes.add<std::uint32_t>(5).name("b.jpg").add<std::uint64_t>(1);
  bytes.add(10.0).add(20.0).add<std::int64_t>(-1);
  bytes.add<std::uint32_t>(2);
  for (const double p : {2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0}) bytes.add(p);
  bytes.add<std::uint32_t>(5).name("a.jpg").add<std::uint64_t>(0);
  return bytes.text();
}

constexpr const char* cameras_txt = "# comment\n5 PINHOLE 640 480 500 510 321 239\n";
constexpr const char* images_txt =
    "# comment\n1 0.70710678118 0 0 0.70710678118 2 -1 -3 5 b.jpg\n10 20 -1\n"
    "2 2 0 0 0 0 0 0 5 a.jpg\n\n";

class Colmap : public ::testing::Test {
 protected:
  void write_binary() const {
    write(folder_ / "cameras.bin", cameras_bin());
    write(folder_ / "images.bin", images_bin());
  }
  void write_text() const {
    write(folder_ / "cameras.txt", cameras_txt);
    write(folder_ / "images.txt", images_txt);
  }
  void expect_both_images() const {
    const auto images = read_colmap(folder_.path(), Distortion::refused);
    ASSERT_EQ(images.size(), 2u);
    EXPECT_EQ(images[0].name, "a.jpg");
    EXPECT_EQ(images[1].name, "b.jpg");
    const Camera& camera = images[1].camera;
    EXPECT_EQ(camera.size_px, glm::ivec2(640, 480));
    EXPECT_EQ(camera.focal_px, glm::vec2(500, 510));
    EXPECT_EQ(camera.principal_point_px, glm::vec2(321, 239));
    const Pose& pose = camera.world_from_camera;
    EXPECT_NEAR(pose.position.x, 1.0f, 1e-6f);
    EXPECT_NEAR(pose.position.y, 2.0f, 1e-6f);
    EXPECT_NEAR(pose.position.z, 3.0f, 1e-6f);
    const glm::vec3 right = pose.orientation * glm::vec3(1, 0, 0);  // world_from_camera: y to x
    EXPECT_NEAR(right.y, -1.0f, 1e-6f);
  }
  void expect_error(const std::string& message) const {
    EXPECT_THAT([this] { (void)read_colmap(folder_.path(), Distortion::refused); },
                ThrowsMessage<InputError>(HasSubstr(message)));
  }

  const test::TemporaryFolder folder_;
};

TEST_F(Colmap, ReadsBinary) {
  write_binary();
  expect_both_images();
}

TEST_F(Colmap, ReadsText) {
  write_text();
  expect_both_images();
}

TEST_F(Colmap, ThatEndsEarlyIsAnErrorWhereverItEnds) {
  write_binary();
  const std::string whole = images_bin();
  for (std::size_t size = 0; size < whole.size(); ++size) {
    write(folder_ / "images.bin", whole.substr(0, size));
    EXPECT_THROW((void)read_colmap(folder_.path(), Distortion::refused), InputError) << size;
  }
}

TEST_F(Colmap, CountsAreNotTrusted) {
  write_binary();
  std::string many = images_bin();
  many.replace(many.size() - 8, 8, 8, '\xff');  // points of the last image
  write(folder_ / "images.bin", many);
  expect_error("points do not fit the file");
}

TEST_F(Colmap, DistortedPicturesAreRefused) {
  write_binary();
  write(folder_ / "cameras.bin", cameras_bin(4));
  expect_error("model OPENCV is not a pinhole camera (colmap image_undistorter");
  write(folder_ / "cameras.bin", cameras_bin());
  std::filesystem::remove(folder_ / "images.bin");
  write_text();
  write(folder_ / "cameras.txt", "5 OPENCV 640 480 500 510 321 239 0 0 0 0\n");
  expect_error("cameras.txt: line 1: model OPENCV is not a pinhole camera");
  write(folder_ / "cameras.txt", "5 SPHERE 640 480 500 510\n");
  expect_error("cameras.txt: line 1: unknown camera model SPHERE");
}

TEST_F(Colmap, DistortionCanBeIgnored) {
  write_text();
  write(folder_ / "cameras.txt", "5 SIMPLE_RADIAL 640 480 500 321 239 0.1\n");
  const auto images = read_colmap(folder_.path(), Distortion::ignored);
  ASSERT_EQ(images.size(), 2u);
  EXPECT_EQ(images[0].camera.focal_px, glm::vec2(500, 500));
  EXPECT_EQ(images[0].camera.principal_point_px, glm::vec2(321, 239));
  write(folder_ / "cameras.txt", "5 SIMPLE_RADIAL 640 480 500 321 239\n");
  EXPECT_THROW((void)read_colmap(folder_.path(), Distortion::ignored), InputError);
}

TEST_F(Colmap, MistakesNameTheirLine) {
  expect_error("has no COLMAP reconstruction");
  write_text();
  write(folder_ / "images.txt", "# c\n1 1 0 0 0 0 0 0 6 a.jpg\n\n");
  expect_error("images.txt: line 2: there is no camera 6");
  write(folder_ / "images.txt", "1 0 0 0 0 0 0 0 5 a.jpg\n\n");
  expect_error("its pose is not a rotation");
  for (const char* infinite : {"1e308 0 0 0 0 0 0", "1 0 0 0 1e39 0 0"}) {
    write(folder_ / "images.txt", fmt::format("1 {} 5 a.jpg\n\n", infinite));
    expect_error("its pose is not a rotation");
  }
  write(folder_ / "images.txt", "1 1 0 0 0 0 0 0 5\n\n");
  expect_error("is not an image");
  write(folder_ / "images.txt", "# none\n");
  expect_error("has no images");
  write(folder_ / "cameras.txt", "5 PINHOLE 640 480 500 -510 321 239\n");
  expect_error("cameras.txt: line 1: has no usable size");
  write(folder_ / "cameras.txt", "5 PINHOLE 640 480 500\n");
  expect_error("cameras.txt: line 1: is not a camera");
}

}  // namespace
}  // namespace catgs

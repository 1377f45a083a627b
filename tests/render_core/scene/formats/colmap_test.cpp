// COLMAP reconstructions, binary and text.
#include "render_core/scene/formats/colmap.h"

#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include <fmt/format.h>

#include "tests/render_core/scene/scene_test_support.h"

namespace catgs::test {
namespace {

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

class Colmap : public FolderTest {
 protected:
  void write_binary() const {
    write("cameras.bin", cameras_bin());
    write("images.bin", images_bin());
  }
  void write_text() const {
    write("cameras.txt", cameras_txt);
    write("images.txt", images_txt);
  }
  void expect_both_images() const {
    const auto images = read_colmap(folder_.path(), Distortion::refused);
    ASSERT_EQ(images.size(), 2u);
    EXPECT_EQ(images[0].name, "a.jpg");
    EXPECT_EQ(images[1].name, "b.jpg");
    const Camera camera = make_camera(images[1].lens, images[1].lens.size_px);
    EXPECT_EQ(camera.size_px, glm::ivec2(640, 480));
    EXPECT_EQ(camera.focal_px, glm::vec2(500, 510));
    EXPECT_EQ(camera.principal_point_px, glm::vec2(321, 239));
    const Pose& pose = images[1].world_from_camera;
    EXPECT_NEAR(pose.position.x, 1.0f, 1e-6f);
    EXPECT_NEAR(pose.position.y, 2.0f, 1e-6f);
    EXPECT_NEAR(pose.position.z, 3.0f, 1e-6f);
    const glm::vec3 right = pose.orientation * glm::vec3(1, 0, 0);  // world_from_camera: y to x
    EXPECT_NEAR(right.y, -1.0f, 1e-6f);
  }
  void expect_refused(const std::string& file, const std::string& where) const {
    EXPECT_EQ(refusal_of([this] { (void)read_colmap(folder_.path(), Distortion::refused); }),
              (Refusal{(file.empty() ? folder_.path() : folder_ / file).string(), where}));
  }
  /// The file with these lines must be refused.
  void expect_refused_with(const std::string& file, const std::string& lines,
                           const std::string& where) const {
    SCOPED_TRACE(lines);
    write(file, lines);
    expect_refused(file, where);
  }
};

TEST_F(Colmap, BinaryFilesAreRead) {
  write_binary();
  expect_both_images();
}

TEST_F(Colmap, TextFilesAreRead) {
  write_text();
  expect_both_images();
}

TEST_F(Colmap, StrayEmptyLinesDoNotMatter) {
  const std::string b = "1 0.70710678118 0 0 0.70710678118 2 -1 -3 5 b.jpg",
                    a = "2 2 0 0 0 0 0 0 5 a.jpg";
  const std::string points = "10 20 -1 1.5e1 -3 7";
  for (const std::string& text : {
           "\n\n" + b + "\n" + points + "\n" + a + "\n\n",
           b + "\n" + points + "\n\n\n" + a + "\n\n\n\n",
           b + "\n\n" + points + "\n" + a + "\n",
           b + "\n" + a,
           b + "\n \t\n" + a + "\n" + points + "\n  \n",
           "\r\n" + b + " \r\n" + points + " \r\n\r\n" + a + "\r\n\r\n",
       }) {
    SCOPED_TRACE(text);
    write("cameras.txt", "\n  \n" + std::string(cameras_txt) + " \n");
    write("images.txt", text);
    expect_both_images();
  }
}

TEST_F(Colmap, LaterModelsAreReadWithoutTheirDistortion) {
  struct Case {
    int id;
    const char* name;
    std::size_t parameters;
  };
  for (const Case& c : std::vector<Case>{{11, "RAD_TAN_THIN_PRISM_FISHEYE", 16},
                                         {12, "SIMPLE_DIVISION", 4},
                                         {13, "DIVISION", 5},
                                         {14, "SIMPLE_FISHEYE", 3},
                                         {15, "FISHEYE", 4},
                                         {16, "EUCM", 6}}) {
    SCOPED_TRACE(c.name);
    std::string text = fmt::format("5 {} 640 480", c.name);
    Bytes bytes;
    bytes.add<std::uint64_t>(1).add<std::uint32_t>(5).add<std::int32_t>(c.id);
    bytes.add<std::uint64_t>(640).add<std::uint64_t>(480);
    for (std::size_t i = 0; i < c.parameters; ++i) {
      text += fmt::format(" {}", 100 + i);
      bytes.add(100.0 + static_cast<double>(i));
    }
    std::filesystem::remove(folder_ / "images.bin");
    write("images.txt", images_txt);
    write("cameras.txt", text + "\n");
    EXPECT_EQ(read_colmap(folder_.path(), Distortion::ignored).size(), 2u);
    expect_refused("cameras.txt", "line 1");
    write("images.bin", images_bin());
    write("cameras.bin", bytes.text());
    EXPECT_EQ(read_colmap(folder_.path(), Distortion::ignored).size(), 2u);
    expect_refused("cameras.bin", "byte 8");
  }
  write("cameras.bin", cameras_bin(17));  // a panorama
  EXPECT_THROW((void)read_colmap(folder_.path(), Distortion::ignored), InputError);
}

TEST_F(Colmap, TruncatedFilesAreRefusedAtEveryLength) {
  write_binary();
  const std::string whole = images_bin();
  for (std::size_t size = 0; size < whole.size(); ++size) {
    write("images.bin", whole.substr(0, size));
    EXPECT_THROW((void)read_colmap(folder_.path(), Distortion::refused), InputError) << size;
  }
}

TEST_F(Colmap, CountsAreNotTrusted) {
  write_binary();
  std::string many = images_bin();
  many.replace(many.size() - 8, 8, 8, '\xff');  // points of the last image
  expect_refused_with("images.bin", many, fmt::format("byte {}", many.size()));
}

TEST_F(Colmap, DistortedPicturesAreRefused) {
  write_binary();
  expect_refused_with("cameras.bin", cameras_bin(4), "byte 8");
  write("cameras.bin", cameras_bin());
  std::filesystem::remove(folder_ / "images.bin");
  write_text();
  expect_refused_with("cameras.txt", "5 OPENCV 640 480 500 510 321 239 0 0 0 0\n", "line 1");
  expect_refused_with("cameras.txt", "5 SPHERE 640 480 500 510\n", "line 1");
}

TEST_F(Colmap, DistortionCanBeIgnored) {
  write_text();
  write("cameras.txt", "5 SIMPLE_RADIAL 640 480 500 321 239 0.1\n");
  const auto images = read_colmap(folder_.path(), Distortion::ignored);
  ASSERT_EQ(images.size(), 2u);
  const Camera camera = make_camera(images[0].lens, {640, 480});
  EXPECT_EQ(camera.focal_px, glm::vec2(500, 500));
  EXPECT_EQ(camera.principal_point_px, glm::vec2(321, 239));
  write("cameras.txt", "5 SIMPLE_RADIAL 640 480 500 321 239\n");
  EXPECT_THROW((void)read_colmap(folder_.path(), Distortion::ignored), InputError);
}

TEST_F(Colmap, MistakesNameTheirLine) {
  expect_refused("", "");
  write_text();
  for (const char* image :
       {"1 1 0 0 0 0 0 0 6 a.jpg", "1 0 0 0 0 0 0 0 5 a.jpg", "1 1e308 0 0 0 0 0 0 5 a.jpg",
        "1 1 0 0 0 1e39 0 0 5 a.jpg", "1 1 0 0 0 0 0 0 5"})
    expect_refused_with("images.txt", fmt::format("# c\n{}\n\n", image), "line 2");
  write("images.txt", "# none\n");
  expect_refused("", "");
  for (const char* camera : {"5 PINHOLE 640 480 500 -510 321 239", "5 PINHOLE 640 480 500"})
    expect_refused_with("cameras.txt", fmt::format("{}\n", camera), "line 1");
}

}  // namespace
}  // namespace catgs::test

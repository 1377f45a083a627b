// catgs-render frames and compare: what pictures and videos hold, and what two folders of pictures
// have in common.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <initializer_list>
#include <iterator>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "render_core/image/png.h"
#include "render_core/motion/trajectory.h"
#include "render_core/scene/files/load_scene.h"
#include "render_core/scene/files/save_scene.h"
#include "tests/render_core/tools/run_catgs_render.h"
#include "tests/support/read_rgba.h"
#include "tests/support/temporary_folder.h"

namespace catgs {
namespace {

using test::Outcome;
using test::run;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

/// A wall of opaque, flat Gaussians at z = 3 before the right half of a camera at the origin.
GaussianCloud wall() {
  GaussianCloud cloud;
  cloud.resize(21 * 41, 0);
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    cloud.mean[i] = {0.5f + 0.1f * static_cast<float>(i % 21),
                     -2.0f + 0.1f * static_cast<float>(i / 21), 3.0f};
    cloud.rotation[i] = glm::quat(1, 0, 0, 0);
    cloud.scale[i] = glm::vec3(0.08f, 0.08f, 0.001f);
    cloud.opacity[i] = 0.99f;
    cloud.sh[i] = glm::vec3(1.0f, 0.0f, -1.0f);
  }
  return cloud;
}

class Frames : public ::testing::Test {
 protected:
  void SetUp() override {
    save_scene(wall(), folder_ / "wall.ply");
    write_tum(path("still.tum"), {{0, {}}, {500'000, {}}, {1'000'000, {}}});
  }
  std::string path(const std::string& name) const { return (folder_ / name).string(); }
  Outcome frames(const std::string& arguments) const {
    return run(
        fmt::format("--quiet frames {} --size 64x48 --focal-px 40 --near 0.1 --renderer cpu {}",
                    path("wall.ply"), arguments));
  }
  void draw(const std::string& name, const std::string& flags) const {
    const Outcome outcome =
        frames(fmt::format("--trace {} --out {} {}", path("still.tum"), path(name), flags));
    ASSERT_EQ(outcome.exit_code, 0) << outcome.out;
  }
  std::size_t files_in(const std::string& name) const {
    return static_cast<std::size_t>(
        std::distance(std::filesystem::directory_iterator(path(name)), {}));
  }
  std::string bytes_of(const std::string& name) const {
    std::ifstream file(path(name), std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
  }

  const test::TemporaryFolder folder_;
};

TEST_F(Frames, TheBackgroundIsBehindTheScene) {
  draw("a.png", "--background ff8000");
  const Image image = read_png(path("a.png"));
  EXPECT_EQ(image.row(24)[0], 1.0f);
  EXPECT_EQ(image.row(24)[1], 128.0f / 255.0f);
  EXPECT_EQ(image.row(24)[2], 0.0f);
  draw("b.png", "--background white");
  EXPECT_EQ(read_png(path("b.png")).row(24)[2], 1.0f);
  for (const char* wrong : {"grey", "ff80", "-10000", "ff80001"}) {
    const Outcome outcome =
        frames(fmt::format("--script still --out {} --background={}", path("c.png"), wrong));
    EXPECT_EQ(outcome.exit_code, 2);
    EXPECT_THAT(outcome.out, HasSubstr("is not a colour (white, black or six"));
  }
}

TEST_F(Frames, AlphaIsWhatHidesTheBackground) {
  draw("a.png", "--alpha");
  draw("black.png", "");
  const std::vector<std::uint8_t> rgba = test::read_rgba(path("a.png"));
  const Image black = read_png(path("black.png"));
  ASSERT_EQ(rgba.size(), 4 * black.pixels());
  const auto alpha = [&](std::size_t x, std::size_t y) { return rgba[4 * (y * 64 + x) + 3]; };
  EXPECT_EQ(alpha(5, 24), 0);
  EXPECT_GE(alpha(50, 24), 252);
  // Over black it is the picture without alpha.
  for (std::size_t i = 0; i < black.rgb.size(); ++i) {
    const double over_black = rgba[i / 3 * 4 + i % 3] / 255.0 * rgba[i / 3 * 4 + 3] / 255.0;
    ASSERT_NEAR(over_black, static_cast<double>(black.rgb[i]), 1.5 / 255.0) << i;
  }
  const Outcome both =
      frames(fmt::format("--script still --out {} --alpha --background white", path("b.png")));
  EXPECT_EQ(both.exit_code, 2);
  const Outcome video = frames(fmt::format("--script still --out {} --alpha", path("b.y4m")));
  EXPECT_EQ(video.exit_code, 2);
  EXPECT_THAT(video.out, HasSubstr("a video holds colours only"));
}

TEST_F(Frames, DepthIsANumPyArrayOfDistancesAlongTheAxis) {
  draw("pictures", "--depth");
  EXPECT_EQ(files_in("pictures"), 2u);
  const std::string npy = bytes_of("pictures/frame_000000.npy");
  EXPECT_EQ(npy.substr(0, 8), std::string("\x93NUMPY\x01\x00", 8));
  std::uint16_t header = 0;
  std::memcpy(&header, npy.data() + 8, sizeof header);
  EXPECT_EQ((10 + header) % 64, 0);
  EXPECT_THAT(npy.substr(10, header),
              HasSubstr("{'descr': '<f4', 'fortran_order': False, 'shape': (48, 64), }"));
  ASSERT_EQ(npy.size(), 10u + header + 64 * 48 * sizeof(float));
  const auto depth = [&](std::size_t x, std::size_t y) {
    float value = 0.0f;
    std::memcpy(&value, npy.data() + 10 + header + (y * 64 + x) * sizeof value, sizeof value);
    return value;
  };
  EXPECT_NEAR(depth(50, 24), 3.0f, 0.01f);
  EXPECT_NEAR(depth(45, 10), 3.0f, 0.01f);
  EXPECT_EQ(depth(5, 24), 0.0f);
}

TEST_F(Frames, ACameraAtRestIsOneFrame) {
  draw("still", "");
  EXPECT_EQ(files_in("still"), 1u);
  draw("all", "--frames 0:3");
  EXPECT_EQ(files_in("all"), 3u);
  const Outcome scripted = frames("--script still --out " + path("scripted.png"));
  EXPECT_EQ(scripted.exit_code, 0) << scripted.out;
  const Outcome second = frames("--script still --duration 1 --fps 5 --out " + path("a_second"));
  EXPECT_EQ(second.exit_code, 0) << second.out;
  EXPECT_EQ(files_in("a_second"), 5u);
}

TEST_F(Frames, VideosHaveThirtyFramesPerSecond) {
  const auto header = [&](const std::string& flags) {
    const Outcome outcome = frames(fmt::format("{} --out {}", flags, path("a.y4m")));
    EXPECT_EQ(outcome.exit_code, 0) << outcome.out;
    return bytes_of("a.y4m").substr(0, 40);
  };
  EXPECT_THAT(header("--script orbit --duration 0.2"), HasSubstr(" F30000:1000 "));
  EXPECT_THAT(header("--script orbit --duration 0.2 --fps 50"), HasSubstr(" F50000:1000 "));
  Trajectory fast, slow;
  for (int i = 0; i < 25; ++i) {
    const Pose pose{{0.01f * static_cast<float>(i), 0, 0}, {1, 0, 0, 0}};
    fast.push_back({i * 10'000, pose});
    slow.push_back({i * 40'000, pose});
  }
  write_tum(path("fast.tum"), fast);
  write_tum(path("slow.tum"), slow);
  EXPECT_THAT(header("--trace " + path("fast.tum")), HasSubstr(" F30000:1000 "));
  EXPECT_THAT(header("--trace " + path("slow.tum")), HasSubstr(" F25000:1000 "));
}

TEST_F(Frames, CompareTakesFolders) {
  for (const char* folder : {"a", "b"}) std::filesystem::create_directory(path(folder));
  draw("a/one.png", "");
  draw("b/one.png", "");
  draw("a/two.png", "");
  draw("b/two.png", "--background 101010");
  draw("b/three.png", "");
  const std::string folders = path("a") + " " + path("b");
  const Outcome text = run("compare " + folders);
  ASSERT_EQ(text.exit_code, 0) << text.out;
  EXPECT_THAT(text.out, AllOf(HasSubstr("one "), HasSubstr("two "), HasSubstr("mean "),
                              HasSubstr("1 pictures of ")));
  const auto json = nlohmann::json::parse(run("compare --json " + folders).out);
  EXPECT_TRUE(json.at("per_view").at("one").at("psnr_db").is_null());
  EXPECT_EQ(json.at("per_view").at("one").at("ssim"), 1.0);
  EXPECT_NEAR(json.at("per_view").at("two").at("psnr_db").get<double>(), 26.0, 3.0);
  EXPECT_NEAR(json.at("mean").at("ssim").get<double>(),
              0.5 + 0.5 * json.at("per_view").at("two").at("ssim").get<double>(), 1e-9);
  EXPECT_EQ(json.at("left_out"), 1);
  EXPECT_EQ(run("compare --require-psnr 60 " + folders).exit_code, 0);  // ∞ among them
  const Outcome missing = run(fmt::format("compare {} {}", path("b"), path("a")));
  EXPECT_EQ(missing.exit_code, 2);
  EXPECT_THAT(missing.out, HasSubstr("three: is missing"));
  EXPECT_EQ(run(fmt::format("compare {} {}", path("a"), path("b/one.png"))).exit_code, 2);
}

constexpr const char* identity = "[1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]";
/// A turn of OpenGL axes into ours.
constexpr const char* ahead = "[1, 0, 0, 0, 0, -1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1]";

// Wherever cameras come from, the picture is that of --focal-px.
TEST_F(Frames, TheLensOfThePathIsDrawnAtAnySize) {
  struct Case {
    const char *file, *text, *flags;
    const char *size, *focal_px;
    const char* note = "";
  };
  constexpr const char* blender =
      R"({{"camera_angle_x": 1.5707963268, "frames": [{{"transform_matrix": {}}}]}})";
  constexpr const char* fisheye =
      R"({{"camera_model": "OPENCV_FISHEYE", "k1": 0.25, "w": 64, "h": 48, "fl_x": 50,
           "frames": [{{"transform_matrix": {}}}]}})";
  constexpr const char* no_size =
      R"({{"fl_x": 50, "cx": 32, "cy": 24, "frames": [{{"transform_matrix": {}}}]}})";
  constexpr const char* viewer = R"({{"camera_path": [{{"camera_to_world": {}, "fov": 90}}]}})";
  constexpr const char* training =
      R"([{"img_name": "a", "width": 64, "height": 48, "fx": 50, "fy": 50, "position": [0, 0, 0],
           "rotation": [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}])";
  for (const auto& [file, text, flags, size, focal_px, note] : std::vector<Case>{
           {"transforms_test.json", blender, "--size 60x60", "60x60", "30"},
           {"transforms_test.json", blender, "", "1280x720", "640", "tells no size; 1280x720"},
           {"transforms.json", no_size, "", "64x48", "50"},
           {"transforms.json", no_size, "--size 128x96", "128x96", "100"},
           {"camera_path.json", viewer, "--size 80x48", "80x48", "24"},
           {"transforms.json", fisheye, "", "64x48", "50", "without its OPENCV_FISHEYE k1 0.25"},
           {"transforms.json", fisheye, "--fov-deg 90", "64x48", "24"},
           {"cameras.json", training, "--size 128x96", "128x96", "100"},
           {"cameras.json", training, "--focal-px 70", "64x48", "70"},
           {"sparse/0/images.txt", "1 1 0 0 0 0 0 0 5 a.jpg\n\n", "--size 32x24", "32x24", "25"},
           {"tour.json", viewer, "--size 40x24", "40x24", "12"},
       }) {
    folder_.write("sparse/0/cameras.txt", "5 SIMPLE_PINHOLE 64 48 50 32 24\n");
    folder_.write(file, std::string_view(text).find("{{") == std::string_view::npos
                            ? text
                            : fmt::format(fmt::runtime(text), ahead));
    const bool tour = std::string_view(file) == "tour.json";
    const auto draw_to = [&](const char* out, const std::string& how) {
      const Outcome outcome =
          run(fmt::format("--quiet frames {} --near 0.1 --renderer cpu {} --out {}",
                          path("wall.ply"), how, path(out)));
      EXPECT_EQ(outcome.exit_code, 0) << outcome.out;
      return outcome.out;
    };
    SCOPED_TRACE(fmt::format("{} {}", file, flags));
    const std::string said =
        draw_to("a.png", fmt::format("{}{} {} {}", tour ? "--script tour:" : "--trace ", path(file),
                                     tour ? "--frames 0:1" : "", flags));
    EXPECT_THAT(said, HasSubstr(note));
    draw_to("b.png",
            fmt::format("--trace {} --size {} --focal-px {}", path("still.tum"), size, focal_px));
    EXPECT_EQ(read_png(path("a.png")).rgb, read_png(path("b.png")).rgb);
  }
}

TEST_F(Frames, EachPictureHasItsOwnLensAndName) {
  folder_.write("transforms_test.json", fmt::format(R"({{"w": 64, "h": 48, "frames": [
      {{"file_path": "./test/r_0", "fl_x": 30, "transform_matrix": {0}}},
      {{"file_path": "./test/r_1", "fl_x": 60, "transform_matrix": {0}}}]}})",
                                                    ahead));
  // Found beside the scene, as test views.
  const std::string start =
      fmt::format("--quiet frames {} --near 0.1 --renderer cpu ", path("wall.ply"));
  const Outcome views = run(start + "--out " + path("views"));
  ASSERT_EQ(views.exit_code, 0) << views.out;
  EXPECT_EQ(files_in("views"), 2u);
  for (const auto& [name, focal_px] : {std::pair{"r_0", 30}, std::pair{"r_1", 60}}) {
    ASSERT_EQ(run(fmt::format("{} --size 64x48 --focal-px {} --trace {} --out {}", start, focal_px,
                              path("still.tum"), path("one.png")))
                  .exit_code,
              0);
    EXPECT_EQ(read_png(path(fmt::format("views/{}.png", name))).rgb, read_png(path("one.png")).rgb)
        << name;
  }
  const Outcome second = run(start + "--frames 1:2 --out " + path("second"));
  EXPECT_TRUE(std::filesystem::exists(path("second/r_1.png"))) << second.out;
  const Outcome resampled = run(start + "--fps 60 --out " + path("no"));
  EXPECT_EQ(resampled.exit_code, 2);
  EXPECT_THAT(resampled.out, HasSubstr("transforms_test.json: its cameras have several lenses"));
}

TEST_F(Frames, RefusesLensesThatNoPictureShows) {
  for (
      const auto& [fields, word] : std::initializer_list<std::array<const char*, 2>>{
          {R"("camera_model": "EQUIRECTANGULAR", "w": 64, "h": 32, "frames": [{"transform_matrix":)",
           "EQUIRECTANGULAR"},
          {R"("is_fisheye": true, "frames": [{"transform_matrix":)", "FISHEYE"},
          {R"("camera_type": "equirectangular", "camera_path": [{"camera_to_world":)",
           "EQUIRECTANGULAR"}}) {
    const auto file = folder_.write("a.json", fmt::format("{{{} {}}}]}}", fields, identity));
    const std::string start =
        fmt::format("frames {} --renderer cpu --trace {} ", path("wall.ply"), file.string());
    const Outcome refused = run(start + "--size 64x48 --out " + path("no.png"));
    EXPECT_EQ(refused.exit_code, 2);
    EXPECT_THAT(refused.out, AllOf(HasSubstr(word), HasSubstr("--fov-deg")));
    for (const char* flags : {"--fov-deg 60 --size 64x48", "--panorama --size 64x32"})
      EXPECT_EQ(run(start + flags + " --out " + path("a.png")).exit_code, 0) << flags;
  }
}

TEST_F(Frames, CompareNotesOtherCameras) {
  write_tum(path("aside.tum"), {{0, {{0.25f, 0, 0}, {1, 0, 0, 0}}}});
  draw("a.png", "");
  ASSERT_EQ(frames(fmt::format("--trace {} --out {}", path("aside.tum"), path("b.png"))).exit_code,
            0);
  ASSERT_EQ(run(fmt::format("--quiet frames {} --size 64x48 --focal-px 41 --near 0.1 --renderer "
                            "cpu --trace {} --out {}",
                            path("wall.ply"), path("still.tum"), path("c.png")))
                .exit_code,
            0);
  const auto compare = [&](const std::string& pictures) { return run("compare " + pictures).out; };
  EXPECT_THAT(compare(path("a.png") + " " + path("b.png")),
              AllOf(HasSubstr("0.25 units, 0 degrees"), HasSubstr("frames --trace path.tum")));
  EXPECT_THAT(compare(path("a.png") + " " + path("c.png")), HasSubstr("1 px of focal length"));
  EXPECT_THAT(compare(path("a.png") + " " + path("a.png")), Not(HasSubstr("other cameras")));
  for (const char* folder : {"x", "y"}) std::filesystem::create_directory(path(folder));
  for (const char* to : {"x/1.png", "x/2.png", "y/1.png"})
    std::filesystem::copy_file(path("a.png"), path(to));
  std::filesystem::copy_file(path("b.png"), path("y/2.png"));
  EXPECT_THAT(compare(path("x") + " " + path("y")), HasSubstr("note: 1 pictures were drawn by"));
}

/// A trace and a clip plane in each scene's file coordinates give what they give near 0.
TEST_F(Frames, FarScenesClipAndTellCamerasInFileCoordinates) {
  const glm::dvec3 there(500123.0, 5412345.0, 431.0);
  const std::string by = fmt::format("--translate={},{},{}", there.x, there.y, there.z);
  ASSERT_EQ(run(fmt::format("convert {} {} {}", path("wall.ply"), path("far.ply"), by)).exit_code,
            0);
  const std::string crop = fmt::format("--crop={},{},{},{},{},{}", there.x + 1.4, there.y + 0.5,
                                       there.z, there.x + 3, there.y + 3, there.z + 5);
  ASSERT_EQ(run(fmt::format("convert {} {} {}", path("far.ply"), path("part.ply"), crop)).exit_code,
            0);
  ASSERT_EQ(run(fmt::format("convert {} {}", path("far.ply"), path("far.tree"))).exit_code, 0);
  write_tum(path("far.tum"), {{0, {}}}, there);
  const auto shown = [&](const std::string& in, const std::string& trace, double d,
                         const std::string& more = "") {
    const std::string out = path(fmt::format("{}_{}.png", in, d));
    const Outcome done = run(fmt::format(
        "--quiet frames {} --size 64x48 --focal-px 40 --near 0.1 --renderer cpu --trace {} "
        "--clip=1,0,0,{:.3f} --out {} {}",
        path(in), path(trace), d, out, more));
    EXPECT_EQ(done.exit_code, 0) << done.out;
    return out;
  };
  const std::string near = shown("wall.ply", "still.tum", 1.25);
  const std::string whole = shown("wall.ply", "still.tum", 100.0);
  const std::string clipped = shown("far.ply", "far.tum", there.x + 1.25);
  const std::string pages = shown("far.tree", "far.tum", there.x + 1.25, "--detail 0");
  const auto alike = [&](const std::string& a, const std::string& b, const std::string& flag) {
    return run(fmt::format("compare {} {} {}", a, b, flag)).exit_code == 0;
  };
  EXPECT_TRUE(alike(near, clipped, "--require-psnr 50"));
  EXPECT_TRUE(alike(near, pages, "--require-psnr 30"));
  EXPECT_FALSE(alike(near, whole, "--require-psnr 30")) << "the plane cuts the wall";

  // Both copies are drawn from one place in the file's coordinates, about origins of their own.
  const std::string part = shown("part.ply", "far.tum", there.x + 100);
  EXPECT_NE(load_scene(path("part.ply")).hints.origin, load_scene(path("far.ply")).hints.origin);
  EXPECT_TRUE(alike(clipped, part, "--require-same-cameras"));
  EXPECT_FALSE(alike(near, clipped, "--require-same-cameras"));
  EXPECT_THAT(run(fmt::format("compare {} {}", near, clipped)).out, HasSubstr("5.44e+06 units"));
}

/// Pictures of the CPU core against the reference, and what they show.
TEST_F(Frames, OrthographicViewsAndSectionsEqualTheReference) {
  std::ofstream(path("wall.json")) << R"({"up": "-y"})";
  const auto drawn = [&](const std::string& renderer, const std::string& flags) {
    const std::string out = path(renderer + ".png");
    const Outcome done = run(fmt::format(
        "--quiet frames {} --size 64x48 --near 0.1 --renderer {} --trace {} --out {} {}",
        path("wall.ply"), renderer, path("still.tum"), out, flags));
    EXPECT_EQ(done.exit_code, 0) << done.out;
    return out;
  };
  // The wall begins at x = 0.5: at the 40th of 64 columns of a view that is 4 units high.
  struct Case {
    const char* flags;
    int dark_column, wall_column;
  };
  for (const auto& [flags, dark, wall] :
       {Case{"--orthographic 4", 33, 44}, Case{"--orthographic 8", 31, 40},
        Case{"--orthographic 4 --section=2,0,3,1.56,1,3.9,0", 42, 52},
        // A quarter of a turn about the vertical changes width and depth.
        Case{"--orthographic 4 --section=2,0,3,1,1.56,3.9,90", 42, 52},
        Case{"--focal-px 40 --section=2,0,3,1.56,1,3.9,0", 44, 54}}) {
    SCOPED_TRACE(flags);
    const std::string picture = drawn("cpu", flags), expected = drawn("reference", flags);
    EXPECT_EQ(run(fmt::format("compare {} {} --require-psnr 55 --require-same-cameras", picture,
                              expected))
                  .exit_code,
              0);
    const Image image = read_png(picture);
    EXPECT_LT(image.row(24)[static_cast<std::ptrdiff_t>(3) * dark], 0.1f);
    EXPECT_GT(image.row(24)[static_cast<std::ptrdiff_t>(3) * wall], 0.6f);
  }
}

TEST_F(Frames, StereoPicturesShowBothEyes) {
  draw("both.png", "--stereo --eye-distance 0.6");
  const Image both = read_png(path("both.png"));
  ASSERT_EQ(both.size_px, glm::ivec2(128, 48));
  EXPECT_EQ(bytes_of("both.png").find("catgs-camera"), std::string::npos) << "no camera drew both";
  // The wall is 3 away and begins right of the head, so its edge lies 40 * 0.6 / 3 px apart.
  const auto begin_in = [&](int left_px) {
    int column = left_px;
    while (column < left_px + 64 && both.row(24)[3 * column] < 0.4f) ++column;
    return column - left_px;
  };
  EXPECT_NEAR(begin_in(0) - begin_in(64), 8, 1) << "further right for the left eye";
  EXPECT_NEAR(begin_in(64), 33, 3);
  for (const char* wrong : {"--eye-distance 0.6", "--stereo --panorama", "--stereo --alpha",
                            "--stereo --depth", "--stereo --orthographic 4"})
    EXPECT_NE(frames(fmt::format("--script still --out {} {}", path("no.png"), wrong)).exit_code, 0)
        << wrong;
}

TEST_F(Frames, APanoramaShowsAllAround) {
  std::ofstream(path("wall.json")) << R"({"up": "-y"})";
  const auto panorama = [&](const std::string& size, const std::string& out) {
    return run(fmt::format(
        "--quiet frames {} --panorama --size {} --near 0.1 --renderer cpu --trace {} --out {}",
        path("wall.ply"), size, path("still.tum"), path(out)));
  };
  ASSERT_EQ(panorama("128x64", "around.png").exit_code, 0);
  const Image image = read_png(folder_ / "around.png");
  ASSERT_EQ(image.size_px, glm::ivec2(128, 64));
  EXPECT_GT(image.row(32)[3 * 74], 0.7f) << "the wall, to the right of the middle";
  EXPECT_EQ(image.row(32)[3 * 54], 0.0f) << "nothing to the left";
  EXPECT_EQ(image.row(32)[3 * 2], 0.0f) << "nothing behind";
  for (const auto& [size, out, word] : std::initializer_list<std::array<const char*, 3>>{
           {"64x64", "no.png", "--size"}, {"128x64", "no.mp4", "--panorama"}}) {
    const Outcome refused = panorama(size, out);
    EXPECT_EQ(refused.exit_code, 2);
    EXPECT_THAT(refused.out, HasSubstr(word));
  }
  EXPECT_THAT(run(fmt::format("frames {} --panorama --script orbit --renderer cpu --out {}",
                              path("wall.ply"), path("no.png")))
                  .out,
              HasSubstr("one picture for 300 frames"))
      << "a size is chosen";
}

}  // namespace
}  // namespace catgs

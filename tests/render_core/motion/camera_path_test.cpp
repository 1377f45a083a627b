// Camera paths in every form that is taken: one camera, written by each program in its own way.
#include "render_core/motion/camera_path.h"

#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "tests/support/refusal.h"
#include "tests/support/temporary_folder.h"

namespace catgs {
namespace {

/// The test camera stands at (1, 2, 3) and looks along +x; its image's down is the world's +y.
constexpr const char* our_rows = "[[0, 0, 1], [0, 1, 0], [-1, 0, 0]]";
constexpr const char* opengl_rows = "[0, 0, -1, 1], [0, -1, 0, 2], [-1, 0, 0, 3]";
constexpr const char* opengl_flat = "[0, 0, -1, 1, 0, -1, 0, 2, -1, 0, 0, 3, 0, 0, 0, 1]";

class CameraPaths : public ::testing::Test {
 protected:
  CameraPath read(const std::string& name, const std::string& text) const {
    return read_camera_path(folder_.write(name, text));
  }

  static void expect_camera(const Pose& pose) {
    EXPECT_LT(glm::distance(pose.position, glm::vec3(1, 2, 3)), 1e-5f);
    EXPECT_LT(glm::distance(pose.orientation * glm::vec3(0, 0, 1), glm::vec3(1, 0, 0)), 1e-5f);
    EXPECT_LT(glm::distance(pose.orientation * glm::vec3(0, 1, 0), glm::vec3(0, 1, 0)), 1e-5f);
  }

  /// `path` has the test camera as its second of two, `step_us` after the first.
  static void expect_path(const CameraPath& path, std::int64_t step_us) {
    ASSERT_EQ(path.poses.size(), 2u);
    EXPECT_EQ(path.poses[0].time_us, 0);
    EXPECT_EQ(path.poses[1].time_us, step_us);
    expect_camera(path.poses[1].world_from_camera);
  }

  /// The lens of all poses, in a picture of `size_px`.
  static void expect_lens(const CameraPath& path, glm::ivec2 size_px, glm::vec2 focal_px,
                          glm::vec2 principal_point_px) {
    ASSERT_EQ(path.lenses.size(), path.poses.size());
    for (const Lens& lens : path.lenses) {
      ASSERT_TRUE(lens.known());
      const Camera camera = make_camera(lens, size_px);
      EXPECT_LT(glm::distance(camera.focal_px, focal_px), 1e-3f);
      EXPECT_LT(glm::distance(camera.principal_point_px, principal_point_px), 1e-4f);
    }
  }

  const test::TemporaryFolder folder_;
};

TEST_F(CameraPaths, Tum) {
  const CameraPath path = read("a.tum",
                               "0 0 0 0 0 0 0 1\n"
                               "0.5 1 2 3 0 0.70710678 0 0.70710678\n");
  expect_path(path, 500'000);
  EXPECT_TRUE(path.lenses.empty() && path.names.empty());
}

TEST_F(CameraPaths, CamerasOfATrainingInTheOrderOfTheirNames) {
  const auto camera = [](const char* name, const char* position, const char* rotation, int fx) {
    return fmt::format(R"({{"id": 0, "img_name": "{}", "width": 64, "height": 48, "position": {},
                           "rotation": {}, "fx": {}, "fy": 41}})",
                       name, position, rotation, fx);
  };
  const std::string first = camera("a", "[0, 0, 0]", "[[1, 0, 0], [0, 1, 0], [0, 0, 1]]", 40);
  const CameraPath path =
      read("cameras.json", fmt::format("[{}, {}]", camera("b", "[1, 2, 3]", our_rows, 40), first));
  expect_path(path, 33'333);
  expect_lens(path, {64, 48}, {40, 41}, {32, 24});
  EXPECT_EQ(path.lenses[0].size_px, glm::ivec2(64, 48));
  EXPECT_EQ(path.names, (std::vector<std::string>{"a", "b"}));
}

TEST_F(CameraPaths, TransformsOfADataSet) {
  const std::string frames =
      fmt::format(R"("frames": [{{"file_path": "b", "transform_matrix": [[1, 0, 0, 0], [0, 1, 0, 0],
                     [0, 0, 1, 0], [0, 0, 0, 1]]}}, {{"file_path": "a", "transform_matrix":
                     [{}, [0, 0, 0, 1]]}}])",
                  opengl_rows);
  const CameraPath path =
      read("transforms.json",
           R"({"fl_x": 40, "fl_y": 41, "cx": 31, "cy": 23, "w": 64, "h": 48, )" + frames + "}");
  expect_path(path, 33'333);
  expect_lens(path, {64, 48}, {40, 41}, {31, 23});
  const CameraPath blender = read(
      "transforms_test.json", R"({"camera_angle_x": 1.5707963, "w": 64, "h": 48, )" + frames + "}");
  expect_lens(blender, {64, 48}, {32, 32}, {32, 24});
  EXPECT_EQ(blender.names, (std::vector<std::string>{"b", "a"}));
}

// Focal lengths follow the picture's height, and a lone horizontal angle its width.
TEST_F(CameraPaths, LensesFitPicturesOfAnySize) {
  struct Case {
    const char* fields;
    glm::ivec2 size_px;
    glm::vec2 focal_px, principal_point_px;
  };
  const char* pose = "[1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]";
  constexpr const char* whole = R"("fl_x": 40, "fl_y": 41, "cx": 31, "cy": 23, "w": 64, "h": 48)";
  for (const auto& [fields, size_px, focal_px, principal_point_px] : std::vector<Case>{
           {R"("camera_angle_x": 1.5707963268)", {64, 48}, {32, 32}, {32, 24}},
           {R"("camera_angle_x": 1.5707963268)", {800, 800}, {400, 400}, {400, 400}},
           {R"("camera_angle_y": 1.5707963268)", {64, 48}, {24, 24}, {32, 24}},
           {R"("x_fov": 90)", {64, 48}, {32, 32}, {32, 24}},
           {R"("y_fov": 90)", {64, 48}, {24, 24}, {32, 24}},
           {R"("camera_angle_x": 1.5707963268, "camera_angle_y": 1.5707963268)",
            {64, 48},
            {24, 24},
            {32, 24}},
           {R"("camera_angle_x": 1.5707963268, "w": 64, "h": 48)", {32, 24}, {16, 16}, {16, 12}},
           {R"("camera_angle_x": 1.5707963268, "w": 64, "h": 48)", {96, 48}, {32, 32}, {48, 24}},
           {whole, {64, 48}, {40, 41}, {31, 23}},
           {whole, {32, 24}, {20, 20.5f}, {15.5f, 11.5f}},
           {whole, {64, 24}, {20, 20.5f}, {31.5f, 11.5f}},
           {whole, {21, 16}, {13.125f, 13.6667f}, {10.171875f, 7.66667f}},
       }) {
    SCOPED_TRACE(fmt::format("{} at {}x{}", fields, size_px.x, size_px.y));
    expect_lens(read("a.json", fmt::format(R"({{{}, "frames": [{{"transform_matrix": {}}}]}})",
                                           fields, pose)),
                size_px, focal_px, principal_point_px);
    expect_lens(read("b.json", fmt::format(R"({{"frames": [{{{}, "transform_matrix": {}}}]}})",
                                           fields, pose)),
                size_px, focal_px, principal_point_px);
  }
  expect_lens(
      read("path.json",
           fmt::format(R"({{"camera_path": [{{"camera_to_world": {}, "fov": 90}}]}})", pose)),
      {64, 48}, {24, 24}, {32, 24});
}

TEST_F(CameraPaths, LensesThatBendLinesAreNamed) {
  struct Case {
    const char *fields, *distortion;
    bool known = true;
  };
  const char* frames =
      R"("frames": [{"transform_matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]}])";
  for (const auto& [fields, distortion, known] : std::vector<Case>{
           {R"("camera_model": "OPENCV", "k1": 0, "p2": 0.0)", ""},
           {R"("camera_model": "PINHOLE")", ""},
           {R"("is_fisheye": false)", ""},
           {R"("camera_model": "OPENCV", "k1": 0.1, "p2": -0.02)", "OPENCV k1 0.1 p2 -0.02"},
           {R"("k1": 0.1)", "k1 0.1"},
           {R"("camera_model": "OPENCV_FISHEYE", "k1": 0)", "OPENCV_FISHEYE"},
           {R"("is_fisheye": true, "k4": 0.5)", "FISHEYE k4 0.5"},
           {R"("camera_model": "novel")", "NOVEL"},
           {R"("ftheta_p1": 0.01)", "ftheta_p1 0.01"},
           {R"("camera_model": "EQUIRECTANGULAR")", "EQUIRECTANGULAR", false},
           {R"("camera_model": "VR180_L")", "VR180_L", false},
           {R"("latlong": true)", "EQUIRECTANGULAR", false},
       }) {
    const CameraPath path =
        read("a.json", fmt::format(R"({{{}, "fl_x": 40, "w": 64, "h": 48, {}}})", fields, frames));
    EXPECT_EQ(path.lenses.at(0).distortion, distortion) << fields;
    EXPECT_EQ(path.lenses.at(0).known(), known) << fields;
  }
  for (const auto& [camera, distortion] : std::vector<std::pair<const char*, const char*>>{
           {"OPENCV 64 48 40 41 31 23 0 0 0 0", ""},
           {"SIMPLE_RADIAL 64 48 40 31 23 0.25", "SIMPLE_RADIAL 0.25"},
           {"FOV 64 48 40 41 31 23 0.5", "FOV 0.5"},
           {"OPENCV_FISHEYE 64 48 40 41 31 23 0 0 0 0", "OPENCV_FISHEYE 0, 0, 0, 0"},
       }) {
    folder_.write("cameras.txt", fmt::format("5 {}\n", camera));
    const auto images = folder_.write("images.txt", "1 1 0 0 0 0 0 0 5 a.jpg\n\n");
    EXPECT_EQ(read_camera_path(images).lenses.at(0).distortion, distortion) << camera;
  }
}

TEST_F(CameraPaths, TheViewersPathHasItsOwnTimesAndLens) {
  const auto path = [&](const std::string& more) {
    return read("path.json", fmt::format(R"({{"camera_type": "perspective", "render_width": 64,
                     "render_height": 48, "keyframes": [], {} "camera_path": [{{"camera_to_world":
                     [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1], "fov": 90, "aspect": 1.3}},
                     {{"camera_to_world": {}, "fov": 90}}]}})",
                                         more, opengl_flat));
  };
  expect_path(path(R"("fps": 24,)"), 41'667);
  expect_path(path(R"("seconds": 4,)"), 2'000'000);
  expect_path(path(""), 33'333);
  expect_lens(path(""), {64, 48}, {24, 24}, {32, 24});
}

TEST_F(CameraPaths, ExportedCameras) {
  expect_path(read("transforms_train.json",
                   fmt::format(R"([{{"file_path": "a", "transform": [[1, 0, 0, 0], [0, 1, 0, 0],
                                   [0, 0, 1, 0]]}}, {{"file_path": "b", "transform": [{}]}}])",
                               opengl_rows)),
              33'333);
}

TEST_F(CameraPaths, ColmapByItsFolderOrFileWhateverTheLens) {
  folder_.write("sparse/0/cameras.txt", "5 OPENCV 64 48 40 41 31 23 0.1 0 0 0\n");
  // camera_from_world: turned by -90 degrees about y, and -R (1, 2, 3).
  const auto file = folder_.write("sparse/0/images.txt",
                                  "1 0.70710678 0 -0.70710678 0 3 -2 -1 5 b.jpg\n\n"
                                  "2 1 0 0 0 0 0 0 5 a.jpg\n\n");
  for (const auto& name : {folder_.path(), file}) {
    const CameraPath path = read_camera_path(name);
    expect_path(path, 33'333);
    expect_lens(path, {64, 48}, {40, 41}, {31, 23});
  }
  EXPECT_EQ(read_camera_path(file, 2.0).poses[1].time_us, 500'000);
}

TEST_F(CameraPaths, PlacesFarFromZeroKeepTheirDigits) {
  constexpr glm::dvec3 first(500123.4, 5412345.3, 431.2), second(500124.5, 5412345.1, 431.3);
  const auto line = [](const char* form, const glm::dvec3& at) {
    return fmt::format(fmt::runtime(form), at.x, at.y, at.z);
  };
  folder_.write("cameras.txt", "5 PINHOLE 64 48 40 41 31 23\n");
  const std::vector<std::filesystem::path> files = {
      folder_.write("a.tum",
                    line("0 {} {} {} 0 0 0 1\n", first) + line("1 {} {} {} 0 0 0 1\n", second)),
      folder_.write("images.txt", line("1 1 0 0 0 {} {} {} 5 a.jpg\n\n", -first) +
                                      line("2 1 0 0 0 {} {} {} 5 b.jpg\n\n", -second)),
      folder_.write("a.json",
                    line(R"({{"frames": [{{"transform_matrix": [[1, 0, 0, {}], [0, -1, 0, {}],
                             [0, 0, -1, {}], [0, 0, 0, 1]]}},)",
                         first) +
                        line(R"({{"transform_matrix": [1, 0, 0, {}, 0, -1, 0, {}, 0, 0, -1, {},
                                 0, 0, 0, 1]}}]}})",
                             second))};
  const glm::dvec3 scene_origin(500100.0, 5412300.0, 400.0);
  for (const auto& file : files) {
    const CameraPath path = read_camera_path(file);
    EXPECT_LT(glm::distance(path.origin, first), 2.0) << file;
    EXPECT_EQ(path.origin, glm::round(path.origin)) << "whole units";
    const Trajectory poses = path.poses_about(scene_origin);
    ASSERT_EQ(poses.size(), 2u) << file;
    for (std::size_t i = 0; i < 2; ++i)
      EXPECT_LT(glm::distance(glm::dvec3(poses[i].world_from_camera.position) + scene_origin,
                              i == 0 ? first : second),
                1e-4)
          << file;
    write_tum(folder_ / "again.tum", poses, scene_origin);
    const Trajectory again = read_tum(folder_ / "again.tum", scene_origin);
    EXPECT_EQ(again[1].world_from_camera.position, poses[1].world_from_camera.position);
  }
}

TEST_F(CameraPaths, TheContentTellsTheForm) {
  const std::string text = fmt::format(R"( [{{"transform": [{}]}}])", opengl_rows);
  expect_camera(read("path.txt", text).poses.at(0).world_from_camera);
}

TEST_F(CameraPaths, MistakesNameTheirField) {
  struct Mistake {
    const char *text, *where;
  };
  for (const auto& [text, where] : std::vector<Mistake>{
           {"[]", ""},
           {"{}", ""},
           {R"({"camera_path": [{"camera_to_world": [1, 2]}]})", "camera_path[0].camera_to_world"},
           {R"({"frames": [{"transform_matrix": [[1, 0, 0, 0], [0, 1, 0, 0],
                            [0, 0, 5, 0], [0, 0, 0, 1]]}]})",
            "frames[0].transform_matrix"},
           {R"([{"position": [0, 0, 0]}])", "[0]"},
           {R"({"fps": 1e6, "camera_path": [{"camera_to_world":
                            [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]}]})",
            ""},
       })
    EXPECT_EQ(test::refusal_of([&] { read("a.json", text); }),
              (test::Refusal{(folder_ / "a.json").string(), where}))
        << text;
  EXPECT_EQ(test::refusal_of([&] { read_camera_path(folder_.path()); }),
            (test::Refusal{folder_.path().string(), ""}));
}

}  // namespace
}  // namespace catgs

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <sstream>

#include "render_core/motion/trajectory.h"
#include "render_core/scene/formats/colmap.h"
#include "server/config/config.h"
#include "tests/fuzz/target.h"
#include "tests/support/temporary_folder.h"

namespace catgs::fuzz {
namespace {

void parse_tum(Bytes input) {
  const Trajectory poses = read_tum(FileInMemory(input).path());
  require(!poses.empty(), "a trajectory holds a pose");
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const Pose& pose = poses[i].world_from_camera;
    require(i == 0 || poses[i - 1].time_us < poses[i].time_us, "times increase");
    require(std::isfinite(glm::length(pose.position)), "positions are finite");
    require(std::abs(glm::length(pose.orientation) - 1.0f) < 1e-3f, "orientations have length 1");
  }
}

std::map<std::string, std::string> tum_seeds() {
  return {{"three",
           "# timestamp tx ty tz qx qy qz qw\n0 0 0 0 0 0 0 1\n0.5 1 2 3 0 0 0.7071 0.7071\n"
           "\n1.25\t-1e-3 2 3.5 0.5 0.5 0.5 0.5\r\n"}};
}

/// Both names lead to files in memory.
struct ColmapFolder {
  explicit ColmapFolder(const std::string& extension) {
    std::filesystem::create_symlink(cameras.path(), folder / ("cameras" + extension));
    std::filesystem::create_symlink(images.path(), folder / ("images" + extension));
  }
  FileInMemory cameras, images;
  test::TemporaryFolder folder;
};

/// A reconstruction: which form, the length of the cameras' file (2 bytes), that file, the images'.
void parse_colmap(Bytes input) {
  if (input.size() < 3) throw InputError("input", "", "is no reconstruction");
  const bool text = input[0] == std::byte{'t'};
  const std::size_t length =
      std::min<std::size_t>(load_as<std::uint16_t>(input.data() + 1), input.size() - 3);
  static ColmapFolder binary_folder(".bin"), text_folder(".txt");
  ColmapFolder& folder = text ? text_folder : binary_folder;
  folder.cameras.rewrite(input.subspan(3, length));
  folder.images.rewrite(input.subspan(3 + length));
  for (const ListedCamera& image : read_colmap(folder.folder.path(), Distortion::ignored)) {
    const Camera camera = make_camera(image.lens, image.lens.size_px);
    const Pose& pose = image.world_from_camera;
    require(std::isfinite(glm::length(glm::dvec3(pose.position))), "positions are finite");
    require(std::abs(glm::length(pose.orientation) - 1.0f) < 1e-3f, "orientations have length 1");
    require(camera.size_px.x > 0 && camera.size_px.y > 0, "pictures have sides");
    require(camera.focal_px.x > 0.0f && std::isfinite(camera.focal_px.x) &&
                camera.focal_px.y > 0.0f && std::isfinite(camera.focal_px.y),
            "focal lengths are lengths");
  }
}

std::map<std::string, std::string> colmap_seeds() {
  const auto with = [](char form, const std::string& cameras, const std::string& images) {
    const auto length = static_cast<std::uint16_t>(cameras.size());
    return form + std::string(reinterpret_cast<const char*>(&length), 2) + cameras + images;
  };
  std::string cameras, images;
  const auto add = [](std::string& to, auto value) {
    to.append(reinterpret_cast<const char*>(&value), sizeof value);
  };
  add(cameras, std::uint64_t{1});
  add(cameras, std::uint32_t{5});
  add(cameras, std::int32_t{1});
  add(cameras, std::uint64_t{640});
  add(cameras, std::uint64_t{480});
  for (const double parameter : {500.0, 510.0, 321.0, 239.0}) add(cameras, parameter);
  add(images, std::uint64_t{1});
  add(images, std::uint32_t{1});
  for (const double value : {1.0, 0.0, 0.0, 0.0, 2.0, -1.0, -3.0}) add(images, value);
  add(images, std::uint32_t{5});
  images.append("b.jpg").push_back('\0');
  add(images, std::uint64_t{1});
  images.append(24, '\0');  // a point
  return {{"binary", with('b', cameras, images)},
          {"text",
           with('t',
                "# CAMERA_ID\n5 PINHOLE 640 480 500 510 321 239\n6 SIMPLE_PINHOLE 64 48 50 32 24\n",
                "1 1 0 0 0 2 -1 -3 5 b.jpg\n10 20 -1\n2 0 1 0 0 0 0 0 6 a c.jpg\n\n")}};
}

ServerConfig read_toml(const std::string& text) {
  ServerConfig config;
  ConfigSources sources;
  apply_toml(FileInMemory(bytes_of(text)).path(), config, sources);
  return config;
}

void parse_config(Bytes input) {
  const std::string printed = print_config(read_toml(text_of(input)), {});
  require(print_config(read_toml(printed), {}) == printed, "--print-config is a file of settings");
}

std::map<std::string, std::string> config_seeds() {
  std::string all;
  std::istringstream lines(print_config({}, {}));
  for (std::string line; std::getline(lines, line);)
    if (line.find("= []") == std::string::npos) all += line + "\n";
  return {{"defaults", all},
          {"museum",
           "scene = [\"a.ply\", 'b c.spz']\nport = 9000 # comment\nopen = true\n"
           "allow-origin = [\n  \"https://a.example\",\n]\nlog-format = \"json\"\n"}};
}

std::vector<std::string> setting_names() {
  std::vector<std::string> words = {
      "\"\"\"",   "'''", "\\u0000", "\\n", "[[", "true", "inf", "0x1F", "1979-05-27T07:32:00Z",
      "{ a = 1 }"};
  for (const Setting& setting : settings()) words.push_back(setting.name + " = ");
  return words;
}

}  // namespace

std::vector<Target> text_files_targets() {
  return {{.name = "tum",
           .parse = parse_tum,
           .seeds = tum_seeds,
           .dictionary = {"nan", "inf", "1e308", "1e-320", "9e9", "-0", " 0 0 0 1\n", "#"},
           .max_bytes = 1024},
          {.name = "colmap",
           .parse = parse_colmap,
           .seeds = colmap_seeds,
           .dictionary = {"PINHOLE", "SIMPLE_PINHOLE", "FULL_OPENCV", "nan", "inf", "1e308", "1e39",
                          "#", "\r\n", "18446744073709551615"},
           .max_bytes = 1024},
          {.name = "config",
           .parse = parse_config,
           .seeds = config_seeds,
           .dictionary = setting_names(),
           .max_bytes = 2048}};
}

}  // namespace catgs::fuzz

#include "render_core/motion/camera_path.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <vector>

#include <fmt/format.h>

#include "render_core/base/error.h"
#include "render_core/scene/formats/colmap.h"
#include "render_core/scene/scene_origin.h"

namespace catgs {
namespace {

namespace fs = std::filesystem;

bool is_json(const fs::path& path) {
  if (path.extension() == ".json") return true;
  std::error_code error;
  if (!fs::is_regular_file(path, error)) return false;  // a pipe can be read only once
  std::ifstream file(path);
  char first = '\0';
  file >> first;
  return first == '{' || first == '[';
}

/// The folder of a reconstruction that is named itself or by its images' file.
std::optional<fs::path> colmap_folder(const fs::path& path) {
  std::error_code error;
  if (fs::is_directory(path, error)) return path;
  const fs::path name = path.filename();
  if (name == "images.bin" || name == "images.txt") return path.parent_path();
  return std::nullopt;
}

CameraPath timed(const fs::path& path, const std::vector<ListedCamera>& cameras, double rate_hz) {
  constexpr double max_rate_hz = 1000.0;
  if (cameras.empty()) throw InputError(path.string(), "", "lists no camera");
  if (!(rate_hz > 0.0 && rate_hz <= max_rate_hz))
    throw InputError(path.string(), "",
                     fmt::format("{} poses per second are out of range", rate_hz),
                     fmt::format("above 0, at most {}", max_rate_hz));
  CameraPath result;
  for (const ListedCamera& listed : cameras) {
    const auto time_us = std::llround(static_cast<double>(result.poses.size()) / rate_hz * 1e6);
    result.poses.push_back({time_us, listed.world_from_camera});
    result.names.push_back(listed.name);
    result.lenses.push_back(listed.lens);
  }
  return result;
}

CameraPath read_about(const fs::path& path, double rate_hz, const glm::dvec3& origin) {
  if (const auto folder = colmap_folder(path))
    return timed(path, read_colmap(*folder, Distortion::ignored, origin), rate_hz);
  if (is_json(path)) {
    const CameraList list = read_camera_json(FileSource(path), origin);
    return timed(path, list.cameras, list.rate_hz.value_or(rate_hz));
  }
  CameraPath result;
  result.poses = read_tum(path, origin);
  return result;
}

}  // namespace

CameraPath read_camera_path(const fs::path& path, double rate_hz) {
  CameraPath result = read_about(path, rate_hz, glm::dvec3(0.0));
  const glm::dvec3 origin = origin_near(result.poses.front().world_from_camera.position);
  if (origin == glm::dvec3(0.0)) return result;
  result = read_about(path, rate_hz, origin);
  result.origin = origin;
  return result;
}

Trajectory CameraPath::poses_about(const glm::dvec3& scene_origin) const {
  Trajectory moved = poses;
  for (TimedPose& pose : moved) {
    glm::vec3& position = pose.world_from_camera.position;
    position = glm::vec3(glm::dvec3(position) + (origin - scene_origin));
  }
  return moved;
}

}  // namespace catgs

#include <algorithm>
#include <array>
#include <cmath>
#include <tuple>
#include <utility>

#include <fmt/format.h>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "render_core/base/error.h"
#include "render_core/first_sight/first_sight.h"
#include "render_core/math/look_at.h"
#include "render_core/scene/analysis/up_axis.h"
#include "render_core/scene/files/hints.h"
#include "render_core/scene/files/view_sample.h"
#include "render_core/scene/formats/camera_list.h"

namespace catgs {

namespace {

struct CameraFile {
  std::string source;
  std::vector<Pose> poses;
};

CameraFile find_cameras(const HintFiles& files, std::vector<std::string>& notes) {
  const auto try_file = [&](const std::filesystem::path& path) -> CameraFile {
    std::error_code error;
    if (path.empty() || !std::filesystem::is_regular_file(path, error)) return {};
    try {
      CameraFile found{path.filename().string(), {}};
      for (const ListedCamera& listed : read_camera_json(FileSource(path), files.origin).cameras)
        found.poses.push_back(listed.world_from_camera);
      return found;
    } catch (const InputError& e) {
      notes.push_back(fmt::format("not used: {}", e.what()));
      return {};
    }
  };
  CameraFile cameras;
  for (const auto* file : {&files.cameras, &files.transforms, &files.test_views})
    if (cameras.poses.empty()) cameras = try_file(*file);
  return cameras;
}

void use_cameras(const CameraFile& cameras, SceneHints& hints) {
  const Pose& first = cameras.poses.front();
  const glm::vec3 forward = first.orientation * glm::vec3(0.0f, 0.0f, 1.0f);
  const float ahead = glm::dot(hints.focus - first.position, forward);
  const float scene_size = glm::distance(hints.limits.min, hints.limits.max);
  hints.focus = first.position + forward * std::max(ahead, 0.02f * scene_size);
  hints.start_pose = look_at(first.position, hints.focus, hints.up);
  Bounds box{first.position, first.position};
  for (const Pose& pose : cameras.poses) {
    box.min = glm::min(box.min, pose.position);
    box.max = glm::max(box.max, pose.position);
  }
  const float margin = std::max(0.5f * glm::distance(box.min, box.max), hints.near_z);
  hints.limits = {box.min - margin, box.max + margin};
  hints.source = cameras.source;
}

/// Narrows the limits to the heights that the orbit reaches, as far as a box with axes of the world
/// can say that, and moves the start there. The box says nothing of the smallest radius.
void use_orbit(const OrbitLimits& orbit, SceneHints& hints) {
  const glm::vec3 reach = glm::max(hints.limits.max - hints.focus, hints.focus - hints.limits.min);
  const float radius = std::max(glm::length(reach), orbit.min_radius);
  const glm::vec3 from_focus = hints.start_pose.position - hints.focus;
  const float distance = std::max({glm::length(from_focus), orbit.min_radius, hints.near_z});
  const float elevation =
      std::asin(std::clamp(glm::dot(from_focus, hints.up) / distance, -1.0f, 1.0f));
  const float allowed = std::clamp(elevation, orbit.min_elevation, orbit.max_elevation);
  const glm::vec3 level = from_focus - glm::dot(from_focus, hints.up) * hints.up;
  if (distance > glm::length(from_focus) || allowed != elevation) {
    const glm::vec3 away = glm::length(level) > 1e-6f * distance
                               ? glm::normalize(level)
                               : hints.start_pose.orientation * glm::vec3(0.0f, 1.0f, 0.0f);
    hints.start_pose =
        look_at(hints.focus + distance * (std::cos(allowed) * away + std::sin(allowed) * hints.up),
                hints.focus, hints.up);
  }
  const auto height = [&](float angle, bool lower) {
    const float sine = std::sin(angle);
    return sine * ((sine < 0.0f) == lower ? radius : orbit.min_radius);
  };
  for (int k = 0; k < 3; ++k) {
    if (std::abs(hints.up[k]) < 0.999f) continue;
    float low = height(orbit.min_elevation, true), high = height(orbit.max_elevation, false);
    if (hints.up[k] < 0.0f) std::tie(low, high) = std::pair(-high, -low);
    const float start = hints.start_pose.position[k];
    hints.limits.min[k] = std::min(start, std::max(hints.limits.min[k], hints.focus[k] + low));
    hints.limits.max[k] = std::max(start, std::min(hints.limits.max[k], hints.focus[k] + high));
  }
  hints.limits.min = glm::min(hints.limits.min, hints.start_pose.position);
  hints.limits.max = glm::max(hints.limits.max, hints.start_pose.position);
  hints.source += ", with the orbit of its file";
}

/// The same hints about another origin.
void count_from(const glm::dvec3& origin, SceneHints& hints) {
  const glm::vec3 by(hints.origin - origin);
  for (glm::vec3* point :
       {&hints.start_pose.position, &hints.limits.min, &hints.limits.max, &hints.focus})
    *point += by;
  hints.origin = origin;
}

}  // namespace

std::optional<Sidecar> sidecar_at(const HintFiles& files) {
  std::error_code error;
  if (files.sidecar.empty() || !std::filesystem::is_regular_file(files.sidecar, error))
    return std::nullopt;
  return read_sidecar(FileSource(files.sidecar), files.origin);
}

bool tell_anything(const HintFiles& files) {
  return files.orbit.has_value() ||
         std::ranges::any_of(
             std::array{files.sidecar, files.cameras, files.transforms, files.test_views},
             [error = std::error_code()](const std::filesystem::path& path) mutable {
               return !path.empty() && std::filesystem::is_regular_file(path, error);
             });
}

std::optional<SplatModel> model_in_sidecar(const HintFiles& files) {
  const std::optional<Sidecar> sidecar = sidecar_at(files);
  return sidecar ? sidecar->model : std::nullopt;
}

void use_model(const HintFiles& files, const std::optional<SplatModel>& wanted, SplatModel& model,
               std::vector<std::string>& notes) {
  model = wanted ? *wanted : model_in_sidecar(files).value_or(model);
  if (model == SplatModel::surfels)
    notes.emplace_back("its model is 2dgs, and its discs are drawn as flat Gaussians");
}

SceneHints find_hints(const std::function<ViewSample()>& sample, const HintFiles& files,
                      const std::optional<glm::vec3>& up, std::vector<std::string>& notes,
                      std::shared_ptr<ThreadPool> pool, const KeepView& keep) {
  const std::optional<Sidecar> sidecar = sidecar_at(files);
  if (sidecar && sidecar->unknown)
    notes.push_back(
        fmt::format("{}: {} is ignored", files.sidecar.filename().string(), *sidecar->unknown));
  const CameraFile cameras = find_cameras(files, notes);

  std::optional<glm::vec3> told = sidecar ? sidecar->up : std::nullopt;
  if (!told) told = up;
  const auto estimate = [&] {
    const auto [cloud, stands_for] = sample();
    const glm::vec3 found =
        told ? *told : find_up(cloud, cameras.poses, stands_for, files.usual_up);
    SceneHints hints = estimate_hints(cloud, found, pool, stands_for);
    hints.origin = files.origin;
    hints.up_is_doubtful = files.usual_up == UsualUp::either_y && !told && cameras.poses.empty();
    return hints;
  };
  SceneHints hints = keep ? keep(estimate) : estimate();
  count_from(files.origin, hints);
  if (!cameras.poses.empty())
    use_cameras(cameras, hints);
  else if (files.orbit)
    use_orbit(*files.orbit, hints);
  if (sidecar) use_sidecar(*sidecar, files.sidecar.filename().string(), hints);
  return hints;
}

}  // namespace catgs

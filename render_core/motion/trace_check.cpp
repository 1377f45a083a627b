#include "render_core/motion/trace_check.h"

#include <algorithm>
#include <vector>

#include <fmt/format.h>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vector_relational.hpp>

#include "render_core/base/even_sample.h"

namespace catgs {
namespace {

std::size_t count_in_view(const Camera& camera, std::span<const glm::vec3> means) {
  const glm::mat3 rotation = camera_from_world_rotation(camera.world_from_camera);
  const glm::vec2 size(camera.size_px);
  std::size_t count = 0;
  for (const glm::vec3& mean : means) {
    const glm::vec3 p = rotation * (mean - camera.world_from_camera.position);
    if (!(p.z > camera.near_z)) continue;
    const glm::vec2 pixel = camera.principal_point_px + camera.focal_px * glm::vec2(p) / p.z;
    count += glm::all(glm::greaterThanEqual(pixel, glm::vec2(0.0f))) &&
                     glm::all(glm::lessThan(pixel, size))
                 ? 1
                 : 0;
  }
  return count;
}

}  // namespace

ScenePosition::ScenePosition(const Bounds& robust_bounds, const SceneHints& hints)
    : bounds(robust_bounds),
      focus(hints.focus),
      distance(glm::distance(hints.start_pose.position, hints.focus)) {}

bool ScenePosition::outside(const glm::vec3& position) const {
  constexpr float rounding = 1.001f;  // an orbit keeps its distance, but for single precision
  return glm::clamp(position, bounds.min, bounds.max) != position &&
         glm::distance(position, focus) > rounding * distance;
}

std::string TraceCheck::complaint() const {
  std::string text;
  if (seeing_frames < wanted_frames) {
    text = fmt::format(
        "only {:.1f} % of {} frames see at least {:.0f} % of the largest in-view count ({:.0f} % "
        "should; frame {} sees {:.1f} %)",
        100.0 * seeing_frames, frames, 100.0 * enough_in_view, 100.0 * wanted_frames,
        emptiest_frame, 100.0 * emptiest_in_view);
  }
  if (outside_frames > 0) {
    text += fmt::format(
        "{}{} of {} frames lie outside of the scene's 5-95 % bounds and farther from its "
        "focus than the first view (first: {})",
        text.empty() ? "" : "; ", outside_frames, frames, *first_outside);
  }
  return text;
}

TraceCheck check_trace(const Trajectory& trajectory, std::span<const glm::vec3> means,
                       const ScenePosition& point, const Camera& lens, ThreadPool& pool) {
  const EvenSample even(means.size(), std::size_t{1} << 17);
  std::vector<glm::vec3> sample;
  for (std::size_t k = 0; k < even.size(); ++k) sample.push_back(means[even[k]]);

  std::vector<std::size_t> in_view(trajectory.size());
  pool.parallel_for(trajectory.size(), [&](std::size_t i) {
    Camera camera = lens;
    camera.world_from_camera = trajectory[i].world_from_camera;
    in_view[i] = count_in_view(camera, sample);
  });

  TraceCheck check;
  check.frames = trajectory.size();
  if (trajectory.empty()) return check;
  const auto largest =
      static_cast<double>(std::max<std::size_t>(*std::ranges::max_element(in_view), 1));
  const auto emptiest = std::ranges::min_element(in_view);
  check.emptiest_frame = static_cast<std::size_t>(emptiest - in_view.begin());
  check.emptiest_in_view = static_cast<double>(*emptiest) / largest;
  const auto seeing = std::ranges::count_if(in_view, [&](std::size_t count) {
    return static_cast<double>(count) >= TraceCheck::enough_in_view * largest;
  });
  check.seeing_frames = static_cast<double>(seeing) / static_cast<double>(check.frames);
  for (std::size_t i = 0; i < trajectory.size(); ++i) {
    const glm::vec3& position = trajectory[i].world_from_camera.position;
    if (!point.outside(position)) continue;
    if (!check.first_outside) check.first_outside = i;
    ++check.outside_frames;
  }
  return check;
}

}  // namespace catgs

#include "render_core/scene/analysis/enclosure.h"

#include <algorithm>

#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>

#include "render_core/math/sphere.h"

namespace catgs {
namespace {

bool is_circle_blocked(const SurfacePoints& surface, const SceneHints& hints) {
  constexpr int pieces = 6;
  constexpr float piece_rad = 1.5707963f / pieces;
  for (const float side : {-1.0f, 1.0f}) {
    const glm::quat turn = glm::angleAxis(side * piece_rad, hints.up);
    glm::vec3 from = hints.start_pose.position - hints.focus;
    for (int k = 0; k < pieces; ++k) {
      const glm::vec3 to = turn * from, way = to - from;
      const float length = glm::length(way);
      if (!(length > 0.0f)) return false;
      const auto hit = surface.hit_along(hints.focus + from, way / length);
      if (hit && hit->distance < length) return true;
      from = to;
    }
  }
  return false;
}

}  // namespace

bool is_start_enclosed(const SurfacePoints& surface, const SceneHints& hints) {
  constexpr std::size_t directions = 96;
  constexpr float enclosed = 0.8f;  // share of all directions
  const auto rays = sphere_directions<directions>();
  const auto stopped = std::ranges::count_if(rays, [&](const glm::vec3& ray) {
    return surface.hit_along(hints.start_pose.position, ray).has_value();
  });
  return static_cast<float>(stopped) > enclosed * directions && is_circle_blocked(surface, hints);
}

}  // namespace catgs

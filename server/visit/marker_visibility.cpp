#include "server/visit/marker_visibility.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>

namespace catgs {
namespace {

using namespace std::chrono_literals;

// The budget of a visit: a ray takes 0.1 ms of the session thread.
constexpr double rays_per_second = 60.0, rays_at_once = 32.0;
// Less light than that from a marker means that something covers it. Foliage lets more through.
constexpr float seen_light = 0.16f;
constexpr auto between_tests = 66ms;
// Shares of the distance to a marker. A camera that has moved less sees the same.
constexpr float same_position = 0.01f;
// A marker lies on a surface, which the ray meets a little before or behind it. A hidden marker
// appears again a little later than it would hide, so that it does not flicker.
constexpr float hides_before = 0.95f, appears_before = 0.97f;

/// Whether something that is drawn covers `point`.
bool is_covered(const SurfacePoints& surface, glm::vec3 eye, const glm::vec3& point,
                const ClipBox& clip, bool was_hidden) {
  const float whole = glm::distance(eye, point);
  if (!(whole > 1e-6f)) return false;
  const glm::vec3 direction = (point - eye) / whole;
  const RayPart part = kept_part(clip, eye, direction);
  const float distance = whole - part.begin;
  const float before =
      std::min((was_hidden ? appears_before : hides_before) * distance, part.end - part.begin);
  if (!(before > 0.0f)) return false;  // nothing between them is drawn
  eye += part.begin * direction;
  return surface.light_from(eye, direction, before, seen_light) < seen_light;
}

/// Where the ray to a point begins: in the plane of an orthographic camera.
glm::vec3 ray_origin(const PoseSample& camera, const glm::vec3& forward, const glm::vec3& point) {
  const glm::vec3& position = camera.world_from_camera.position;
  return camera.view_height > 0.0f ? point - forward * glm::dot(forward, point - position)
                                   : position;
}

}  // namespace

void MarkerVisibility::watch(Markers markers) {
  id_ = markers.id;
  markers_.clear();
  for (const glm::vec3& point : markers.points) markers_.push_back({point, {}});
  next_ = 0;
  told_.reset();
  last_.reset();
}

std::optional<HiddenMarkers> MarkerVisibility::test(const SurfacePoints& surface,
                                                    const PoseSample& camera, const ClipBox& clip,
                                                    TimePoint now) {
  if (markers_.empty() || (last_ && now - *last_ < between_tests)) return std::nullopt;
  last_ = now;
  if (!rays_) rays_.emplace(rays_per_second, rays_at_once, now);
  if (std::exchange(clip_, clip) != clip)
    for (Marker& marker : markers_) marker.tested_from.reset();
  const glm::vec3 forward = camera.world_from_camera.orientation * glm::vec3(0.0f, 0.0f, 1.0f);
  for (std::size_t i = 0; i < markers_.size(); ++i) {
    Marker& marker = markers_[next_];
    const glm::vec3 eye = ray_origin(camera, forward, marker.point), way = marker.point - eye;
    const bool known = marker.tested_from &&
                       glm::distance(*marker.tested_from, eye) <= same_position * glm::length(way);
    if (!known && (!marker.tested_from || glm::dot(forward, way) > 0.0f)) {
      if (!rays_->take(now)) break;
      marker.hidden = is_covered(surface, eye, marker.point, clip, marker.hidden);
      marker.tested_from = eye;
    }
    next_ = (next_ + 1) % markers_.size();
  }
  std::vector<std::uint32_t> hidden;
  for (std::size_t i = 0; i < markers_.size(); ++i) {
    if (!markers_[i].tested_from) return std::nullopt;
    if (markers_[i].hidden) hidden.push_back(static_cast<std::uint32_t>(i));
  }
  if (told_ == hidden) return std::nullopt;
  told_ = hidden;
  return HiddenMarkers{id_, std::move(hidden)};
}

}  // namespace catgs

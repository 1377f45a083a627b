#include <algorithm>
#include <iterator>

#include <glm/common.hpp>

#include "render_core/motion/script_parts.h"

namespace catgs {
namespace {

/// A keyframe and the rate of change with which the tour passes it.
struct Key {
  double time_s;
  glm::dvec3 position;
  glm::dquat orientation;
  glm::dvec3 velocity{0.0};
  glm::dquat spin{0.0, 0.0, 0.0, 0.0};  // change of the four components per second
};

/// Cubic Hermite between two keys `span_s` apart, at the share `t` of the way.
template <typename Value>
Value hermite(const Value& from, const Value& from_rate, const Value& to, const Value& to_rate,
              double span_s, double t) {
  const double share = t * t * (3.0 - 2.0 * t);
  return from * (1.0 - share) + to * share + from_rate * (span_s * t * (1.0 - t) * (1.0 - t)) -
         to_rate * (span_s * t * t * (1.0 - t));
}

/// Rates by central differences (Catmull-Rom for uneven times); at rest at both ends.
std::vector<Key> make_keys(const Trajectory& keyframes) {
  std::vector<Key> keys;
  for (const TimedPose& pose : keyframes) {
    glm::dquat orientation(pose.world_from_camera.orientation);
    if (!keys.empty() && glm::dot(keys.back().orientation, orientation) < 0.0) {
      orientation = -orientation;  // the short way round
    }
    keys.push_back({static_cast<double>(pose.time_us - keyframes.front().time_us) * 1e-6,
                    glm::dvec3(pose.world_from_camera.position), orientation});
  }
  for (std::size_t i = 1; i + 1 < keys.size(); ++i) {
    const double span_s = keys[i + 1].time_s - keys[i - 1].time_s;
    keys[i].velocity = (keys[i + 1].position - keys[i - 1].position) / span_s;
    keys[i].spin = (keys[i + 1].orientation - keys[i - 1].orientation) / span_s;
  }
  return keys;
}

}  // namespace

PoseAt tour_script(const SceneFrame& frame, const Trajectory& keyframes) {
  return [low = frame.low(), high = frame.high(), keys = make_keys(keyframes)](double time_s) {
    const auto next =
        std::upper_bound(keys.begin(), keys.end(), time_s,
                         [](double time, const Key& key) { return time < key.time_s; });
    const Key& a = *std::prev(next);  // the first key is at time 0
    const Key& b = next == keys.end() ? a : *next;
    const double span_s = b.time_s - a.time_s;
    const double t = span_s > 0.0 ? (time_s - a.time_s) / span_s : 0.0;
    const glm::dvec3 position = hermite(a.position, a.velocity, b.position, b.velocity, span_s, t);
    const glm::dquat orientation = hermite(a.orientation, a.spin, b.orientation, b.spin, span_s, t);
    return Pose{glm::clamp(position, low, high), glm::quat(glm::normalize(orientation))};
  };
}

}  // namespace catgs

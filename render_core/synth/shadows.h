#pragma once

#include <vector>

#include <glm/vec3.hpp>

#include "render_core/scene/scene.h"

namespace catgs::synth {

/// Objects that cast shadows: solid boxes and leafy balls. World axes.
class Shadows {
 public:
  explicit Shadows(const glm::vec3& to_sun) : to_sun_(to_sun) {}

  void add_box(const glm::vec3& min, const glm::vec3& max);
  /// A ball that absorbs `density` of the light through its middle, and less towards its rim.
  void add_ball(const glm::vec3& centre, float radius, float density);

  /// Removes all objects that cast no shadow on `region`.
  void keep(const Bounds& region);

  /// Restricts queries to `region`, until the next call: only objects that may shade it count.
  /// Queries outside are wrong.
  void focus(const Bounds& region);

  /// Share of sunlight that reaches a point, in [0, 1].
  [[nodiscard]] float sun_visibility(const glm::vec3& point) const;

 private:
  struct Box {
    glm::vec3 min, max;
  };
  struct Ball {
    glm::vec3 centre;
    float radius;
    float density;
  };
  [[nodiscard]] bool may_shade(const glm::vec3& min, const glm::vec3& max,
                               const Bounds& region) const;

  glm::vec3 to_sun_;
  std::vector<Box> boxes_;
  std::vector<Ball> balls_;
  std::vector<Box> near_boxes_;
  std::vector<Ball> near_balls_;
};

}  // namespace catgs::synth

#pragma once

#include <vector>

#include <glm/vec3.hpp>

#include "render_core/scene/scene.h"

namespace catgs::synth {

/// Things that stand between the sun and what they shade: solid boxes and leafy balls. World axes.
class Shadows {
 public:
  explicit Shadows(const glm::vec3& to_sun) : to_sun_(to_sun) {}

  void add_box(const glm::vec3& min, const glm::vec3& max);
  /// A ball that swallows `density` of the light through its middle and less towards its rim.
  void add_ball(const glm::vec3& centre, float radius, float density);

  /// Forgets for good what shades nothing of `region`.
  void keep(const Bounds& region);

  /// Keeps only what may shade `region` in mind, until the next call. Queries outside are wrong.
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

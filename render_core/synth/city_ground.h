#pragma once

#include <glm/vec2.hpp>

#include "render_core/synth/city_plan.h"
#include "render_core/synth/shapes.h"

namespace catgs::synth {

inline constexpr double road_density = 4.0;  // Gaussians per square metre at detail 1
inline constexpr double pavement_density = 5.0;
inline constexpr float kerb_height = 0.12f;

/// A stretch of ground along an axis: `a` metres along it, `c` metres across from its middle.
struct Ground {
  glm::vec2 origin;
  bool along_x;
  float length;
  float width;
  float haze;
  std::uint64_t key;

  [[nodiscard]] glm::vec3 point(float a, float c, float height) const;
  [[nodiscard]] float detail(float a, float c) const;
  /// The ground from (a0, c0) to (a1, c1), facing up.
  [[nodiscard]] Patch patch(float a0, float a1, float c0, float c1, float height = 0.0f) const;
  [[nodiscard]] Finish asphalt() const;
  [[nodiscard]] Finish line() const;
  [[nodiscard]] Finish paving(float sky_visibility) const;
};

/// Prepares the shadows that fall on a patch.
void focus_on(Painter& painter, const Patch& patch);

/// A rectangle of ground, in pieces small enough for their own detail and shadows. `density` is in
/// Gaussians per square metre at detail 1.
void paint_rectangle(Painter& painter, const Ground& ground, float a0, float a1, float c0, float c1,
                     const Finish& finish, double density, std::uint64_t index, float height = 0.0f,
                     float overlap = 0.56f);

}  // namespace catgs::synth

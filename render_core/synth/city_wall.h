#pragma once

#include "render_core/synth/city_plan.h"
#include "render_core/synth/shapes.h"

namespace catgs::synth {

/// Linear albedos of one building.
struct Palette {
  glm::vec3 wall, trim, shutter, roof;
};

/// One wall of a building: an origin at its foot, metres along and up.
struct Wall {
  const Building& building;
  const Palette& palette;
  glm::vec3 foot;
  glm::vec3 along;  // unit
  glm::vec3 normal;
  float length;
  SideUse use;
  float haze;
  std::uint64_t key;

  [[nodiscard]] glm::vec3 point(float a, float height, float out = 0.0f) const {
    return foot + along * a + up * height + normal * out;
  }
  [[nodiscard]] Patch patch(float a, float height, float width, float tall,
                            float out = 0.0f) const {
    return {point(a, height, out), along * width, up * tall};
  }
  /// Streets are darker below than above.
  [[nodiscard]] float openness(float height) const {
    return 0.50f + 0.42f * smooth_step(0.0f, 16.0f, height);
  }
  [[nodiscard]] Finish finish(const glm::vec3& albedo, float height, float mottle = 0.07f) const {
    return {.albedo = albedo, .sky_visibility = openness(height), .mottle = mottle, .haze = haze};
  }
};

/// The view into a window at this height: its glass, and a room that may be lit.
Finish pane_finish(const Wall& wall, Random& random, float height, float lit_chance);

/// Slopes on the open sides, gables on party walls, a flat top where the slopes leave one, and the
/// objects on it.
void paint_roof(Painter& painter, const Building& building, const Palette& palette, float detail,
                float haze);

/// Windows that project from the steep part of a mansard roof, above one wall.
void paint_dormers(Painter& painter, const Wall& wall, float detail);

}  // namespace catgs::synth

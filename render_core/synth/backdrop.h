#pragma once

#include <glm/vec2.hpp>

#include "render_core/synth/painter.h"

namespace catgs::synth {

/// A shell of sky around `centre` (x, z on the ground), down to a little below the horizon.
void paint_sky(Painter& painter, const glm::vec2& centre, float radius, double weight,
               std::uint64_t key);

/// Land from `inner` to `outer` metres around the centre, fading into haze, with hills behind it.
void paint_horizon(Painter& painter, const glm::vec2& centre, float inner, float outer,
                   const glm::vec3& albedo, double weight, std::uint64_t key);

/// Rings of distant houses and towers, seen through haze.
void paint_skyline(Painter& painter, const glm::vec2& centre, float inner, float outer,
                   double weight, std::uint64_t key);

/// Faint, soft Gaussians like those that training leaves in empty air. Here they look like dust and
/// haze.
void paint_floaters(Painter& painter, const glm::vec3& min, const glm::vec3& max, double weight,
                    std::uint64_t key);

}  // namespace catgs::synth

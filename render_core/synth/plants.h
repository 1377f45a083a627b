#pragma once

#include <glm/vec3.hpp>

#include "render_core/synth/painter.h"

namespace catgs::synth {

/// A broad-leaved tree: trunk, boughs and a crown of leaf clumps. `foot` lies on the ground.
void paint_tree(Painter& painter, const glm::vec3& foot, float height, float crown,
                const glm::vec3& leaf_albedo, float haze, double weight, std::uint64_t key);

/// Albedo of a tree's leaves: greens, and sometimes the first autumn colours.
glm::vec3 leaf_albedo(Random& random);

/// Upright blades or stems over a patch of ground.
void paint_blades(Painter& painter, const glm::vec3& corner, const glm::vec3& u, const glm::vec3& v,
                  float height, const glm::vec3& albedo, float haze, double weight,
                  std::uint64_t key);

/// A flowering plant: stems, leaves and one to several blossoms of one of a few kinds, about a hand
/// wide and up to 45 cm tall. `foot` lies on the ground.
void paint_flower_tuft(Painter& painter, const glm::vec3& foot, double weight, std::uint64_t key);

}  // namespace catgs::synth

#pragma once

#include <glm/vec3.hpp>

#include "render_core/synth/painter.h"

namespace catgs::synth {

/// A flowering plant: stems, leaves and one to several blossoms of one of a few kinds, about a hand
/// wide and up to 45 cm tall. `foot` lies on the ground.
void paint_flower_tuft(Painter& painter, const glm::vec3& foot, double weight, std::uint64_t key);

}  // namespace catgs::synth

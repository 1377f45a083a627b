#pragma once

#include <span>

#include "render_core/math/camera.h"
#include "render_core/scene/gaussian_cloud.h"

namespace catgs {

/// The direction away from gravity, a unit vector. People hold cameras level, so it is the axis at
/// a right angle to the cameras' right vectors, as far as those tell. Without cameras it is the
/// axis on which the largest floor lies, where the usual ones (-y, then +z) win ties; -y where
/// there is no floor. Both are levelled by the floors and walls near to them. Deterministic.
glm::vec3 find_up(const GaussianCloud& cloud, std::span<const Pose> cameras);

}  // namespace catgs

#pragma once

#include <span>

#include "render_core/math/camera.h"
#include "render_core/scene/gaussian_cloud.h"
#include "render_core/scene/usual_up.h"

namespace catgs {

/// The direction away from gravity, a unit vector. People hold cameras level, so it is the axis at
/// a right angle to the cameras' right vectors, as far as those tell. Without cameras it is the
/// axis on which the largest floor or ceiling lies, and what stands on it, has detail and is lit
/// tells its sense. The usual ones (-y, then +z) win ties. Without a floor it is -y or y. All are
/// levelled by the floors and walls near to them. Deterministic, and the same for every level of
/// detail and order of a scene, up to noise. `stands_for`: of an even sample, so many Gaussians of
/// the scene each. `usual`: of its file.
glm::vec3 find_up(const GaussianCloud& cloud, std::span<const Pose> cameras,
                  float stands_for = 1.0f, UsualUp usual = UsualUp::minus_y);

}  // namespace catgs

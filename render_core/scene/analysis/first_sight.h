#pragma once

#include "render_core/math/camera.h"
#include "render_core/scene/gaussian_cloud.h"
#include "render_core/scene/scene.h"

namespace catgs {

/// Orientation of a camera at `eye` that looks at `target` with `up` (unit, world axes) upright in
/// the image. Any orientation around the view axis is taken where the two are parallel.
Pose look_at(const glm::vec3& eye, const glm::vec3& target, const glm::vec3& up);

/// Hints for a scene that comes with none. Up is -y, as in every COLMAP capture, unless given. The
/// pose looks at the content of the robust bounds (5–95 %, opacity-weighted) from a place in free
/// space, judged on a coarse voxel grid. Deterministic.
SceneHints estimate_hints(const GaussianCloud& cloud,
                          const glm::vec3& up = glm::vec3(0.0f, -1.0f, 0.0f));

}  // namespace catgs

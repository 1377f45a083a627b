#pragma once

#include "render_core/motion/trajectory.h"
#include "render_core/scene/scene.h"

namespace catgs {

/// The motion of a trajectory, moved into a scene. It begins at the scene's start pose with the
/// same heading. The recording's up (-y, as in TUM files of this project) becomes the scene's up.
/// Elevation and roll stay as recorded. Distances are kept; poses may leave the scene's limits.
Trajectory anchored(const Trajectory& trajectory, const SceneHints& hints);

}  // namespace catgs

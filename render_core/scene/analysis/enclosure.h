#pragma once

#include "render_core/scene/analysis/surface_points.h"
#include "render_core/scene/scene.h"

namespace catgs {

/// Whether visits begin inside: something stops the sight in most directions, and a camera that
/// circles the focus from the start meets something opaque within a quarter turn.
bool is_start_enclosed(const SurfacePoints& surface, const SceneHints& hints);

}  // namespace catgs

#pragma once

#include "render_core/scene/files/load_scene.h"
#include "render_core/scene/formats/scene_format.h"

namespace catgs {

/// Reads headers alone. A folder of large scenes therefore costs next to nothing, and a scene that
/// is too large can be refused before it is read. A count that the file cannot hold is an error
/// already. Throws InputError, as load_scene() would.
SceneSize read_scene_size(const SceneLocation& scene, const LoadOptions& options = {});

}  // namespace catgs

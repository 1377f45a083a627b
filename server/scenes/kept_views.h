#pragma once

#include "render_core/scene/files/load_scene.h"
#include "server/config/config.h"
#include "server/scenes/derived_files.h"

namespace catgs {

/// Keeps what is estimated of a scene's first view with the derived files, so that it does not
/// change with what is in memory. The answer follows the scene's files, and the up and the cameras
/// that files beside them name. `files`: null: nothing is kept. Throws InputError.
KeepView keep_view(const DerivedFiles* files, const SceneLocation& scene,
                   const ServerConfig& config);

/// When the files were written that tell about a scene's cameras, for names of derived files.
std::string camera_facts(const HintFiles& hints);

}  // namespace catgs

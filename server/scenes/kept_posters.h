#pragma once

#include "server/config/config.h"
#include "server/scenes/derived_files.h"
#include "server/scenes/poster.h"
#include "server/scenes/scene_catalog.h"
#include "server/scenes/scene_folder.h"

namespace catgs {

/// The poster of a scene that is kept with the derived files; null: none. It changes with all that
/// it shows: the scene's files and levels, and what decides where visits begin. `files`: null:
/// nothing is kept. Throws InputError.
Poster kept_poster(const DerivedFiles* files, const FoundScene& found,
                   const SceneRepresentation& representation, const ServerConfig& config);

/// Keeps the poster that a load of the scene makes.
KeepPoster keep_poster(const DerivedFiles* files, const FoundScene& found,
                       const SceneRepresentation& representation, const ServerConfig& config);

}  // namespace catgs

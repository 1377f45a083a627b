#pragma once

#include <cstdint>
#include <memory>

#include "render_core/scene/files/load_scene.h"
#include "render_core/scene/files/locate_scene.h"
#include "render_core/scene/formats/detail_tree.h"
#include "render_core/scene/formats/file_set.h"
#include "render_core/scene/formats/format_limits.h"

namespace catgs {

/// The files of a scene that has levels. Those of an archive are unpacked in memory. Throws
/// InputError.
std::shared_ptr<const FileSet> files_of_levels(const SceneLocation& location);

/// Opens a scene that has levels, at those of `options`. Throws InputError, as the formats' own
/// functions do.
OpenLevels open_levels(const SceneLocation& location, const std::shared_ptr<const FileSet>& files,
                       const LoadOptions& options, std::uint64_t most = max_gaussians);

}  // namespace catgs

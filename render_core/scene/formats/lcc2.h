#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "render_core/scene/formats/detail_tree.h"
#include "render_core/scene/formats/file_set.h"
#include "render_core/scene/formats/format_limits.h"

namespace catgs {

struct SceneFormat;

// LCC2 of XGRIDS (white paper of version 0.0.3): a JSON file, NAME.lcc2, with a tree of regions.
// Each node below the root is a range of the Gaussians of a .sog or .spz file, and its children
// show the same in more detail. The root may name a file of surroundings, which every level has.
// Axes: z up, also inside an .spz, whatever axes that names. Meshes are not read.

/// The files that hold the scene of an .lcc2, as paths from its folder. Throws InputError.
std::vector<std::string> lcc2_files(const ByteSource& file);

/// The scene `index` in `folder`; without `level` and `budget` the finest level. Reads the headers
/// of the files that hold it, and each .sog as a whole, because it is packed. Throws InputError
/// naming the field. Errors include: both are given, there is no such level, the coarsest level
/// exceeds the budget, two nodes share Gaussians, there are more than `most` Gaussians.
OpenLevels open_lcc2(const std::shared_ptr<const FileSet>& folder, const std::string& index,
                     std::optional<int> level, std::optional<std::size_t> budget,
                     std::uint64_t most = max_gaussians);

extern const SceneFormat lcc2_format;

}  // namespace catgs

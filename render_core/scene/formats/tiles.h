#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "render_core/scene/formats/detail_tree.h"
#include "render_core/scene/formats/file_set.h"
#include "render_core/scene/formats/format_limits.h"

namespace catgs {

struct SceneFormat;

// 3D Tiles 1.0 and 1.1 (OGC 22-025r4): tileset.json, a tree of tiles whose contents are glTF files
// with Gaussians, or further tilesets. Implicit tiling and the tile formats of version 1.0 (.b3dm,
// .pnts and others) are not read.
//
// Levels: a tile is as coarse as there are tiles with contents below it. Tiles of refine REPLACE
// give way to their children, those of ADD stay.
//
// Axes and origin: a tileset has z up, and its glTF contents y up. Sums are made in double
// precision before anything becomes a float. A scene on the globe (a root whose middle is near the
// WGS84 ellipsoid) gets an origin of its own in the middle of the root's bounding volume, with
// east, north and up as axes. Another scene farther than 10 km from its origin is moved there
// alone.

/// The tileset `index` in `folder`; without `level` and `budget` the finest level. Reads the JSON
/// of all tiles. Throws InputError naming the field. Errors include: both are given, there is no
/// such level, the coarsest level exceeds the budget, a file is used twice (so tilesets do not hold
/// themselves), there are more than `most` Gaussians.
OpenLevels open_tiles(const std::shared_ptr<const FileSet>& folder, const std::string& index,
                      std::optional<int> level, std::optional<std::size_t> budget,
                      std::uint64_t most = max_gaussians);

extern const SceneFormat tiles_format;

}  // namespace catgs

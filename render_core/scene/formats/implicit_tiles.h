#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "render_core/scene/formats/file_set.h"
#include "render_core/scene/formats/json_field.h"

namespace catgs {

/// One of the tiles that a tile with implicit tiling (3D Tiles 1.1) stands for.
struct ImplicitTile {
  std::optional<std::size_t> above{};   // the tile that holds it; none: it is the tile itself
  std::vector<std::string> contents{};  // URIs, as `tile` would name them
};

/// Reads the subtrees of `tile`: files beside its tileset, which is in `folder`. Each tile comes
/// behind the one that holds it. Throws InputError, also where there are more than `most`.
std::vector<ImplicitTile> read_implicit_tiles(const JsonField& tile, const FileSet& folder,
                                              std::size_t most);

}  // namespace catgs

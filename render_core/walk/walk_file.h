#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "render_core/scene/formats/byte_source.h"
#include "render_core/walk/walk_map.h"

namespace catgs::walk {

// A .walk file: a header of 320 bytes, the scene's origin in version 3 (three doubles; 0 in version
// 2), an index of tiles, and the tiles. All is little-endian. A
// tile has tile_side x tile_side columns, fewer at the map's east and north. Tiles lie row by row,
// east first, then north. So a client can keep the packed file and unpack what is near. The index
// has the packed and the unpacked size of each tile, 4 bytes each: 0 and 0 for a tile without
// places. Each other tile is a zlib stream (RFC 1950) of three parts:
//
//   1. The number of places of each column, a byte each, row by row: east first, then north
//   2. The kind of each place, a byte each
//   3. The height of each place: the difference to the last height of the same rank in a column of
//      the tile (lowest, second…; 0 before the first), as a zigzag varint: (d << 1) ^ (d >> 31),
//      seven bits a byte, low bits first, bit 7 where more follow

inline constexpr std::size_t most_positions = std::size_t{1} << 24, most_in_column = 64;
inline constexpr std::size_t most_storeys = 16;
inline constexpr int tile_side = 64;

/// The three parts of each tile, before they are packed; empty for a tile without places.
std::vector<std::string> tiles_of(const WalkMap& map);

/// The index of these tiles, and the packed tiles behind it.
std::string packed_tiles(std::span<const std::string> tiles);

/// The bytes of a file. Storeys beyond most_storeys join the highest one.
std::string pack(const WalkMap& map);
void write_walk_file(const WalkMap& map, const std::filesystem::path& path);

/// Throws InputError that names the field that is wrong. All values of the map are in range, the
/// places of a column ascend, and the start is clear ground.
WalkMap read_walk_file(const ByteSource& file);

}  // namespace catgs::walk

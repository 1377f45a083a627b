#include "render_core/walk/walk_file.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <cstring>
#include <new>
#include <numeric>
#include <utility>

#include <fmt/format.h>
#include <glm/common.hpp>
#include <glm/gtc/type_ptr.hpp>
#include <zlib.h>

#include "render_core/base/error.h"
#include "render_core/base/part_file.h"
#include "render_core/math/camera.h"

namespace catgs::walk {
namespace {

struct WalkFileHeader {
  static constexpr std::array<char, 8> right_magic = {'c', 'a', 't', 'g', 's', 'w', 'l', 'k'};
  static constexpr std::uint32_t right_version = 2, version_with_origin = 3;

  std::array<char, 8> magic = right_magic;
  std::uint32_t version = right_version;
  std::uint32_t checksum = 0;  // CRC-32 of all bytes behind it
  std::array<float, 3> origin{};
  std::array<float, 9> axes{};  // east, north, up
  float cell = 0.0f;
  std::array<float, 5> person{};  // radius, height, step, slope, chest: shares of the eye height
  float cells_per_eye_height = walk::cells_per_eye_height;
  std::array<float, 3> start{};  // east, north, height; cells
  std::array<std::uint32_t, 2> size{};
  std::uint32_t positions = 0;
  std::uint32_t tile_side = walk::tile_side;
  std::uint32_t packed_bytes = 0;  // the index and the tiles, up to the end of the file
  std::uint32_t storeys = 0;
  std::array<Storey, most_storeys> storey{};
};
static_assert(sizeof(Storey) == 12 && sizeof(WalkFileHeader) == 320);

/// An entry of the index.
struct TileBytes {
  std::uint32_t packed = 0, unpacked = 0;
};

constexpr std::string_view damaged = "the file is damaged: compute it again";

std::uint32_t checksum_of(std::span<const std::byte> bytes) {
  constexpr std::size_t skipped =
      offsetof(WalkFileHeader, checksum) + sizeof(WalkFileHeader::checksum);
  const std::span rest = bytes.subspan(skipped);
  return static_cast<std::uint32_t>(
      crc32_z(0, reinterpret_cast<const Bytef*>(rest.data()), rest.size()));
}

/// Calls body(tile, columns) for each tile of a map of `size`, with the indices of its columns.
template <class Body>
void each_tile(const glm::ivec2& size, const Body& body) {
  std::vector<std::size_t> columns;
  std::size_t tile = 0;
  for (int south = 0; south < size.y; south += tile_side)
    for (int west = 0; west < size.x; west += tile_side, ++tile) {
      columns.clear();
      for (int y = south; y < std::min(south + tile_side, size.y); ++y)
        for (int x = west; x < std::min(west + tile_side, size.x); ++x)
          columns.push_back(static_cast<std::size_t>(y) * static_cast<std::size_t>(size.x) +
                            static_cast<std::size_t>(x));
      body(tile, columns);
    }
}

std::size_t tiles_in(const glm::ivec2& size) {
  const glm::ivec2 tiles = (size + tile_side - 1) / tile_side;
  return static_cast<std::size_t>(tiles.x) * static_cast<std::size_t>(tiles.y);
}

class Reader {
 public:
  explicit Reader(const ByteSource& file) : file_(file) {}

  WalkMap read() {
    constexpr std::uint64_t most_bytes = std::uint64_t{1} << 27;
    const std::vector<std::byte> bytes = file_.read_all(most_bytes);
    require(bytes.size() >= sizeof header_, "header", "is cut off");
    header_ = load_as<WalkFileHeader>(bytes.data());
    if (header_.magic != WalkFileHeader::right_magic)
      throw InputError(file_.name(), "magic", "is not that of a .walk file",
                       "catgs-render floors SCENE OUT.walk makes one");
    if (header_.version != WalkFileHeader::right_version &&
        header_.version != WalkFileHeader::version_with_origin)
      throw InputError(file_.name(), "version", "is not known", "compute it with this version");
    require(header_.checksum == checksum_of(bytes), "checksum", "is wrong");
    read_header();
    std::span<const std::byte> rest = std::span(bytes).subspan(sizeof header_);
    if (header_.version == WalkFileHeader::version_with_origin) rest = read_origin(rest);
    require(header_.packed_bytes == rest.size(), "packed bytes", "are not those behind the header");
    read_tiles(rest);
    const glm::ivec2 start(glm::floor(map_.start.position));
    require(map_.clear_at(start, map_.start.height), "start", "is not clear ground");
    return std::move(map_);
  }

 private:
  void require(bool right, std::string_view field, std::string_view what) const {
    if (!right) throw InputError(file_.name(), field, what, damaged);
  }

  /// Returns the bytes behind it.
  std::span<const std::byte> read_origin(std::span<const std::byte> bytes) {
    require(bytes.size() >= sizeof map_.origin, "origin of the scene", "is cut off");
    std::memcpy(&map_.origin, bytes.data(), sizeof map_.origin);
    for (int k = 0; k < 3; ++k)
      require(std::abs(map_.origin[k]) <= static_cast<double>(max_coordinate),
              "origin of the scene", "is out of range");
    return bytes.subspan(sizeof map_.origin);
  }

  void read_header() {
    const WalkFileHeader& h = header_;
    const auto in = [](const auto& values, float low, float high) {
      return std::ranges::all_of(values, [&](float v) { return v >= low && v <= high; });
    };
    require(in(h.origin, -2 * max_coordinate, 2 * max_coordinate), "origin", "is out of range");
    map_.grid.origin = glm::make_vec3(h.origin.data());
    map_.grid.axes = glm::make_mat3(h.axes.data());
    const glm::mat3 square = glm::transpose(map_.grid.axes) * map_.grid.axes;
    bool turned = in(h.axes, -1.01f, 1.01f) && glm::determinant(map_.grid.axes) > 0.0f;
    for (int k = 0; k < 9; ++k)
      turned &= std::abs(square[k / 3][k % 3] - (k % 4 == 0 ? 1.0f : 0.0f)) < 1e-3f;
    require(turned, "axes", "are not a rotation");
    require(h.cell > 0.0f && h.cell <= max_coordinate, "cell", "is out of range");
    map_.grid.cell = h.cell;
    require(in(h.person, 0.01f, 10.0f) && h.cells_per_eye_height == walk::cells_per_eye_height,
            "person", "is out of range");
    map_.person = {h.person[0], h.person[1], h.person[2], h.person[3], h.person[4]};
    require(in(h.start, 0.0f, grid_side), "start", "is out of range");
    map_.start = {{h.start[0], h.start[1]}, h.start[2]};
    require(h.size[0] >= 1 && h.size[0] <= grid_side && h.size[1] >= 1 && h.size[1] <= grid_side,
            "size", "is out of range");
    map_.size = glm::ivec2(h.size[0], h.size[1]);
    require(h.positions <= std::min(most_positions, columns() * most_in_column), "places",
            "are too many");
    require(h.tile_side == walk::tile_side, "tile side", "is not 64");
    require(h.storeys >= 1 && h.storeys <= most_storeys, "storeys", "are not 1 to 16");
    for (std::uint32_t k = 0; k < h.storeys; ++k) {
      const Storey& s = h.storey[k];
      const float below = k > 0 ? h.storey[k - 1].low : 0.0f;
      require(s.low >= below && s.low <= grid_levels && s.level >= 0.0f && s.level <= grid_levels,
              "storeys", "are out of range");
      map_.storeys.push_back(s);
    }
  }

  [[nodiscard]] std::size_t columns() const {
    return std::size_t{header_.size[0]} * header_.size[1];
  }

  [[nodiscard]] std::vector<std::byte> unpacked(std::span<const std::byte> packed,
                                                std::size_t bytes) const {
    std::vector<std::byte> tile(bytes);
    uLongf size = bytes;
    uLong taken = packed.size();
    const int result = uncompress2(reinterpret_cast<Bytef*>(tile.data()), &size,
                                   reinterpret_cast<const Bytef*>(packed.data()), &taken);
    require(result == Z_OK && size == bytes && taken == packed.size(), "a tile",
            "cannot be unpacked");
    return tile;
  }

  /// The index, whose sizes are those of `bytes` behind it.
  std::vector<TileBytes> read_index(std::span<const std::byte>& bytes) const {
    constexpr std::uint64_t most_growth = 1032;  // of deflate
    constexpr std::size_t most_tile = tile_side * tile_side * (1 + 4 * most_in_column);
    std::vector<TileBytes> index(tiles_in(map_.size));
    const std::size_t index_bytes = index.size() * sizeof(TileBytes);
    require(index_bytes <= bytes.size(), "index", "is cut off");
    std::memcpy(index.data(), bytes.data(), index_bytes);
    bytes = bytes.subspan(index_bytes);
    std::uint64_t packed = 0, unpacked = 0;
    for (const TileBytes& tile : index) {
      const std::uint64_t size = tile.packed, grown = tile.unpacked;
      // zlib packs nothing into more than this.
      require(grown <= most_tile && grown <= most_growth * size && size <= 2 * grown + 64 &&
                  (size == 0) == (grown == 0),
              "index", "has a tile of a wrong size");
      packed += tile.packed;
      unpacked += tile.unpacked;
    }
    require(packed == bytes.size(), "index", "is not that of the tiles");
    // Each place has a kind and a height.
    require(2 * std::uint64_t{header_.positions} <= unpacked, "places",
            "are more than the tiles have");
    return index;
  }

  void read_tiles(std::span<const std::byte> bytes) {
    const std::vector<TileBytes> index = read_index(bytes);
    map_.first.assign(columns() + 1, 0);
    std::vector<Position> by_tile;
    by_tile.reserve(header_.positions);
    each_tile(map_.size, [&](std::size_t t, std::span<const std::size_t> of_tile) {
      if (index[t].packed == 0) return;
      read_tile(unpacked(bytes.first(index[t].packed), index[t].unpacked), of_tile, by_tile);
      bytes = bytes.subspan(index[t].packed);
    });
    require(by_tile.size() == header_.positions, "tiles", "have other places than the file");
    std::partial_sum(map_.first.begin(), map_.first.end(), map_.first.begin());
    map_.positions.resize(by_tile.size());
    auto next = by_tile.begin();
    each_tile(map_.size, [&](std::size_t, std::span<const std::size_t> of_tile) {
      for (const std::size_t c : of_tile)
        for (std::uint32_t i = map_.first[c]; i < map_.first[c + 1]; ++i)
          map_.positions[i] = *next++;
    });
  }

  /// Notes how many places each column has, and appends them to `positions`.
  void read_tile(std::span<const std::byte> bytes, std::span<const std::size_t> of_tile,
                 std::vector<Position>& positions) {
    require(bytes.size() >= of_tile.size(), "a tile", "is cut off");
    const std::span counts = bytes.first(of_tile.size());
    std::size_t count = 0;
    for (const std::byte in_column : counts) count += static_cast<std::size_t>(in_column);
    bytes = bytes.subspan(counts.size());
    require(count <= std::min(bytes.size(), header_.positions - positions.size()), "a tile",
            "has too many places");
    std::span kinds = bytes.first(count);
    bytes = bytes.subspan(count);
    std::array<int, most_in_column> last{};
    for (std::size_t c = 0; c < of_tile.size(); ++c) {
      const auto in_column = static_cast<std::uint32_t>(counts[c]);
      require(in_column <= most_in_column, "a column", "has too many places");
      map_.first[of_tile[c] + 1] = in_column;
      for (std::size_t k = 0; k < in_column; ++k) {
        const auto kind = static_cast<std::uint8_t>(kinds.front());
        kinds = kinds.subspan(1);
        last[k] += read_difference(bytes);
        const bool right = kind <= static_cast<std::uint8_t>(Kind::obstacle) && last[k] >= 0 &&
                           last[k] < grid_levels * static_cast<int>(Position::per_cell) &&
                           (k == 0 || last[k] > last[k - 1]);
        require(right, "a place", "is out of range");
        positions.push_back({static_cast<std::uint16_t>(last[k]), static_cast<Kind>(kind)});
      }
    }
    require(bytes.empty(), "a tile", "has more than its places");
  }

  /// Takes a zigzag varint of at most three bytes.
  int read_difference(std::span<const std::byte>& bytes) const {
    std::uint32_t code = 0;
    for (int shift = 0; shift < 21; shift += 7) {
      require(!bytes.empty(), "heights", "are cut off");
      const auto byte = static_cast<std::uint32_t>(bytes.front());
      bytes = bytes.subspan(1);
      code |= (byte & 127u) << shift;
      if (byte < 128u) return static_cast<int>(code >> 1) ^ -static_cast<int>(code & 1u);
    }
    throw InputError(file_.name(), "heights", "are out of range", damaged);
  }

  const ByteSource& file_;
  WalkFileHeader header_;
  WalkMap map_;
};

}  // namespace

std::vector<std::string> tiles_of(const WalkMap& map) {
  std::vector<std::string> tiles;
  each_tile(map.size, [&](std::size_t, std::span<const std::size_t> columns) {
    std::string counts, kinds, heights;
    std::array<int, most_in_column> last{};
    for (const std::size_t c : columns) {
      counts.push_back(static_cast<char>(map.first[c + 1] - map.first[c]));
      for (std::uint32_t i = map.first[c]; i < map.first[c + 1]; ++i) {
        kinds.push_back(static_cast<char>(map.positions[i].kind));
        const int height = map.positions[i].height;
        const int d = height - std::exchange(last[i - map.first[c]], height);
        std::uint32_t code = static_cast<std::uint32_t>(d) << 1 ^ (d < 0 ? ~0u : 0u);
        for (; code >= 128; code >>= 7) heights.push_back(static_cast<char>(code | 128));
        heights.push_back(static_cast<char>(code));
      }
    }
    tiles.push_back(kinds.empty() ? "" : counts + kinds + heights);
  });
  return tiles;
}

std::string packed_tiles(std::span<const std::string> tiles) {
  std::string index, streams;
  for (const std::string& tile : tiles) {
    uLongf size = tile.empty() ? 0 : compressBound(tile.size());
    std::string stream(size, '\0');
    if (!tile.empty() && compress2(reinterpret_cast<Bytef*>(stream.data()), &size,
                                   reinterpret_cast<const Bytef*>(tile.data()), tile.size(),
                                   Z_BEST_COMPRESSION) != Z_OK)
      throw std::bad_alloc();
    const TileBytes bytes = {static_cast<std::uint32_t>(size),
                             static_cast<std::uint32_t>(tile.size())};
    index.append(reinterpret_cast<const char*>(&bytes), sizeof bytes);
    streams.append(stream, 0, size);
  }
  return index + streams;
}

std::string pack(const WalkMap& map) {
  assert(map.positions.size() <= most_positions);
  const std::string tiles = packed_tiles(tiles_of(map));
  WalkFileHeader h;
  std::memcpy(h.origin.data(), &map.grid.origin, sizeof h.origin);
  std::memcpy(h.axes.data(), &map.grid.axes, sizeof h.axes);
  h.cell = map.grid.cell;
  const Person& p = map.person;
  h.person = {p.radius, p.height, p.step, p.slope, p.chest};
  h.start = {map.start.position.x, map.start.position.y, map.start.height};
  h.size = {static_cast<std::uint32_t>(map.size.x), static_cast<std::uint32_t>(map.size.y)};
  h.positions = static_cast<std::uint32_t>(map.positions.size());
  h.packed_bytes = static_cast<std::uint32_t>(tiles.size());
  h.storeys = static_cast<std::uint32_t>(std::min(map.storeys.size(), most_storeys));
  std::copy_n(map.storeys.begin(), h.storeys, h.storey.begin());
  for (std::size_t k = h.storeys; k < map.storeys.size(); ++k)
    h.storey[h.storeys - 1].area += map.storeys[k].area;
  std::string bytes(sizeof h, '\0');
  if (map.origin != glm::dvec3(0.0)) {
    h.version = WalkFileHeader::version_with_origin;
    bytes.append(reinterpret_cast<const char*>(&map.origin), sizeof map.origin);
  }
  bytes += tiles;
  std::memcpy(bytes.data(), &h, sizeof h);
  h.checksum = checksum_of(std::as_bytes(std::span(bytes)));
  std::memcpy(bytes.data(), &h, sizeof h);
  return bytes;
}

void write_walk_file(const WalkMap& map, const std::filesystem::path& path) {
  std::size_t in_column = 0;
  for (std::size_t c = 0; c + 1 < map.first.size(); ++c)
    in_column = std::max<std::size_t>(in_column, map.first[c + 1] - map.first[c]);
  if (map.positions.size() > most_positions || in_column > most_in_column)
    throw InputError(path.string(), "",
                     fmt::format("{} places, {} of them above each other, are too many",
                                 map.positions.size(), in_column),
                     "give a larger --eye-height");
  const std::string bytes = pack(map);
  PartFile file(path);
  file.stream().write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  file.finish();
}

WalkMap read_walk_file(const ByteSource& file) { return Reader(file).read(); }

}  // namespace catgs::walk

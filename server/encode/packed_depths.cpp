#include "server/encode/packed_depths.h"

#include <algorithm>
#include <cmath>
#include <new>

#include <zlib.h>

namespace catgs {
namespace {

constexpr int window_bits = -12;  // raw deflate; a grid has a few kB
constexpr int memory_level = 8;
constexpr float most_code = 255.0f;

using Codes = std::vector<std::uint8_t>;

std::size_t area(glm::ivec2 cells) {
  return static_cast<std::size_t>(cells.x) * static_cast<std::size_t>(cells.y);
}

std::vector<std::byte> deflated(const Codes& bytes) {
  z_stream stream{};
  if (deflateInit2(&stream, Z_BEST_COMPRESSION, Z_DEFLATED, window_bits, memory_level,
                   Z_DEFAULT_STRATEGY) != Z_OK)
    throw std::bad_alloc();
  std::vector<std::byte> out(deflateBound(&stream, static_cast<uLong>(bytes.size())));
  stream.next_in = const_cast<Bytef*>(bytes.data());
  stream.avail_in = static_cast<uInt>(bytes.size());
  stream.next_out = reinterpret_cast<Bytef*>(out.data());
  stream.avail_out = static_cast<uInt>(out.size());
  deflate(&stream, Z_FINISH);  // has room for all
  out.resize(stream.total_out);
  deflateEnd(&stream);
  return out;
}

}  // namespace

glm::ivec2 depth_cells_of(glm::ivec2 size_px, int eyes) {
  constexpr double cells = 64.0 * 36.0;
  const double aspect = static_cast<double>(size_px.x) / eyes / size_px.y;
  const auto side = [](double count, int most) {
    return std::clamp(static_cast<int>(std::lround(count)), 1, most);
  };
  return {eyes * side(std::sqrt(cells * aspect), max_depth_cells / eyes),
          side(std::sqrt(cells / aspect), max_depth_cells)};
}

PackedDepths pack(const DepthGrid& grid) {
  const float nearest = std::ranges::max(grid.inverse_depths);
  PackedDepths packed{grid.cells, nearest / (most_code * most_code), {}};
  Codes codes(area(grid.cells));
  std::ranges::transform(grid.inverse_depths, codes.begin(), [&](float inverse_depth) {
    const float share = nearest > 0.0f ? inverse_depth / nearest : 0.0f;
    return static_cast<std::uint8_t>(std::lround(most_code * std::sqrt(share)));
  });
  Codes rests(codes.size());
  for (int y = 0, i = 0; y < grid.cells.y; ++y) {
    for (int x = 0; x < grid.cells.x; ++x, ++i) {
      const int rest =
          codes[static_cast<std::size_t>(i)] - expected_code(codes, grid.cells.x, x, y);
      rests[static_cast<std::size_t>(i)] = static_cast<std::uint8_t>(rest);
    }
  }
  packed.codes = deflated(rests);
  return packed;
}

int expected_code(std::span<const std::uint8_t> codes, int columns, int x, int y) {
  const auto at = [&](int column, int row) {
    return int{codes[static_cast<std::size_t>(row * columns + column)]};
  };
  if (y == 0) return x == 0 ? 0 : at(x - 1, 0);
  const int above = at(x, y - 1);
  if (x == 0) return above;
  const int left = at(x - 1, y), corner = at(x - 1, y - 1);
  const auto [low, high] = std::minmax(left, above);
  return std::clamp(left + above - corner, low, high);
}

}  // namespace catgs

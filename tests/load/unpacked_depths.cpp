#include "tests/load/unpacked_depths.h"

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <new>
#include <span>

#include <zlib.h>

namespace catgs::load {
namespace {

/// False: they are not exactly as many bytes.
bool inflate_into(std::span<const std::byte> packed, std::span<std::uint8_t> bytes) {
  constexpr int raw_deflate = -15;
  z_stream stream{};
  if (inflateInit2(&stream, raw_deflate) != Z_OK) throw std::bad_alloc();
  stream.next_in = const_cast<Bytef*>(reinterpret_cast<const Bytef*>(packed.data()));
  stream.avail_in = static_cast<uInt>(packed.size());
  stream.next_out = bytes.data();
  stream.avail_out = static_cast<uInt>(bytes.size());
  const bool ended = inflate(&stream, Z_FINISH) == Z_STREAM_END;
  const bool whole = ended && stream.avail_in == 0 && stream.avail_out == 0;
  inflateEnd(&stream);
  return whole;
}

}  // namespace

std::optional<std::vector<float>> unpack(const PackedDepths& packed) {
  constexpr float most_code = 255.0f;
  const glm::ivec2 cells = packed.cells;
  if (cells.x < 1 || cells.y < 1 || cells.x > max_depth_cells || cells.y > max_depth_cells)
    return {};
  if (!(packed.scale >= 0.0f && std::isfinite(packed.scale * most_code * most_code))) return {};
  std::vector<std::uint8_t> codes(static_cast<std::size_t>(cells.x * cells.y));
  if (!inflate_into(packed.codes, codes)) return {};
  std::vector<float> inverse_depths;
  for (int y = 0; y < cells.y; ++y) {
    for (int x = 0; x < cells.x; ++x) {
      std::uint8_t& code = codes[inverse_depths.size()];
      code = static_cast<std::uint8_t>(code + expected_code(codes, cells.x, x, y));
      const float value = code;
      inverse_depths.push_back(packed.scale * value * value);
    }
  }
  return inverse_depths;
}

}  // namespace catgs::load

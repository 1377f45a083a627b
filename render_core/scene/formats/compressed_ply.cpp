#include "render_core/scene/formats/compressed_ply.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include <fmt/format.h>
#include <glm/common.hpp>

#include "render_core/base/error.h"
#include "render_core/scene/activations.h"
#include "render_core/scene/formats/format_limits.h"

namespace catgs {

namespace {

constexpr std::size_t chunk_size = 256;
constexpr std::size_t block_chunks = 16;

/// Byte offset of `name` in a row of `element`, which must be of `type`.
std::size_t offset_of(const ByteSource& file, const PlyElement& element, const std::string& name,
                      PlyType type) {
  const PlyProperty* property = element.find(name);
  if (!property || property->is_list || property->type != type)
    throw InputError(file.name(), fmt::format("element {} property {}", element.name, name),
                     "is missing or not of the type that a compressed .ply has");
  return property->offset;
}

/// Offsets of a min or max triple.
using Triple = std::array<std::size_t, 3>;

struct Layout {
  const PlyElement *chunk, *vertex, *sh;  // sh: null without view-dependent colours
  Triple min_position, max_position, min_log_scale, max_log_scale, min_colour, max_colour;
  bool has_colour_limits = false;
  std::size_t position, rotation, scale, colour;
  std::vector<std::size_t> rest;  // byte offsets of f_rest_*
};

Layout find_layout(const ByteSource& file, const PlyHeader& header) {
  Layout layout{};
  layout.chunk = header.find("chunk");
  layout.vertex = header.find("vertex");
  layout.sh = header.find("sh");
  const auto triple = [&](const char* prefix, const char* names) {
    Triple offsets{};
    for (std::size_t k = 0; k < 3; ++k)
      offsets[k] = offset_of(file, *layout.chunk, prefix + std::string(1, names[k]), PlyType::f32);
    return offsets;
  };
  layout.min_position = triple("min_", "xyz");
  layout.max_position = triple("max_", "xyz");
  layout.min_log_scale = triple("min_scale_", "xyz");
  layout.max_log_scale = triple("max_scale_", "xyz");
  layout.has_colour_limits = layout.chunk->find("min_r") != nullptr;
  if (layout.has_colour_limits) {
    layout.min_colour = triple("min_", "rgb");
    layout.max_colour = triple("max_", "rgb");
  }
  layout.position = offset_of(file, *layout.vertex, "packed_position", PlyType::u32);
  layout.rotation = offset_of(file, *layout.vertex, "packed_rotation", PlyType::u32);
  layout.scale = offset_of(file, *layout.vertex, "packed_scale", PlyType::u32);
  layout.colour = offset_of(file, *layout.vertex, "packed_color", PlyType::u32);
  if (layout.sh)
    for (std::size_t k = 0; k < layout.sh->properties.size(); ++k)
      layout.rest.push_back(offset_of(file, *layout.sh, fmt::format("f_rest_{}", k), PlyType::u8));
  return layout;
}

int require_consistent(const ByteSource& file, const PlyHeader& header, const Layout& layout) {
  if (header.encoding != PlyEncoding::binary_little_endian)
    throw InputError(file.name(), "header", "a compressed .ply is binary_little_endian");
  require_rows_in_file(file, *layout.vertex);
  require_rows_in_file(file, *layout.chunk);
  const std::uint64_t chunks = (layout.vertex->count + chunk_size - 1) / chunk_size;
  if (layout.chunk->count != chunks)
    throw InputError(file.name(), "element chunk",
                     fmt::format("{} chunks of {} for {} vertices", layout.chunk->count, chunk_size,
                                 layout.vertex->count));
  if (!layout.sh) return 0;
  require_rows_in_file(file, *layout.sh);
  const int degree = layout.rest.size() % 3 == 0 ? sh_degree_of_rest(layout.rest.size() / 3) : -1;
  if (degree < 0 || degree > max_sh_degree || layout.sh->count != layout.vertex->count)
    throw InputError(file.name(), "element sh",
                     fmt::format("{} rows of {} coefficients for {} vertices", layout.sh->count,
                                 layout.rest.size(), layout.vertex->count));
  return degree;
}

glm::vec3 load_triple(const std::byte* row, const Triple& offsets) {
  return {load_as<float>(row + offsets[0]), load_as<float>(row + offsets[1]),
          load_as<float>(row + offsets[2])};
}

/// `bits` of `packed` from `shift` on, as a fraction of their largest value.
float fraction(std::uint32_t packed, int shift, int bits) {
  const std::uint32_t largest = (1u << bits) - 1;
  return static_cast<float>(packed >> shift & largest) / static_cast<float>(largest);
}

glm::vec3 unpack_11_10_11(std::uint32_t packed) {
  return {fraction(packed, 21, 11), fraction(packed, 11, 10), fraction(packed, 0, 11)};
}

/// Two bits name the largest of w, x, y, z; the others follow in order, each in ±sqrt(1/2).
glm::quat unpack_rotation(std::uint32_t packed) {
  const std::uint32_t largest = packed >> 30;
  std::array<float, 4> wxyz{};
  float squares = 0.0f;
  int shift = 20;
  for (std::uint32_t k = 0; k < 4; ++k) {
    if (k == largest) continue;
    wxyz[k] = (fraction(packed, shift, 10) - 0.5f) * 1.41421356f;
    squares += wxyz[k] * wxyz[k];
    shift -= 10;
  }
  wxyz[largest] = std::sqrt(std::max(0.0f, 1.0f - squares));
  return {wxyz[0], wxyz[1], wxyz[2], wxyz[3]};
}

/// The bytes stand for the middles of 256 steps of [-4, 4], the first and the last byte for its
/// ends.
float unpack_sh(std::byte packed) {
  const auto byte = std::to_integer<unsigned>(packed);
  if (byte == 0) return -4.0f;
  if (byte == 255) return 4.0f;
  return ((static_cast<float>(byte) + 0.5f) / 256.0f - 0.5f) * 8.0f;
}

void store(const Layout& layout, const std::byte* chunk, const std::byte* vertex,
           const glm::dvec3& origin, GaussianCloud& cloud, std::size_t i) {
  const auto between = [&](const Triple& min, const Triple& max, const glm::vec3& t) {
    return glm::mix(load_triple(chunk, min), load_triple(chunk, max), t);
  };
  const auto packed = [&](std::size_t offset) { return load_as<std::uint32_t>(vertex + offset); };
  const std::uint32_t rgba = packed(layout.colour);
  glm::vec3 colour(fraction(rgba, 24, 8), fraction(rgba, 16, 8), fraction(rgba, 8, 8));
  if (layout.has_colour_limits) colour = between(layout.min_colour, layout.max_colour, colour);

  const glm::dvec3 low(load_triple(chunk, layout.min_position)),
      high(load_triple(chunk, layout.max_position));
  const glm::dvec3 share(unpack_11_10_11(packed(layout.position)));
  cloud.mean[i] = glm::vec3(glm::mix(low, high, share) - origin);
  cloud.scale[i] = exp(
      between(layout.min_log_scale, layout.max_log_scale, unpack_11_10_11(packed(layout.scale))));
  cloud.rotation[i] = unit(unpack_rotation(packed(layout.rotation)));
  cloud.opacity[i] = opacity_from_byte(static_cast<unsigned char>(rgba & 0xff));
  cloud.sh[i * cloud.sh_count()] = {sh_from_colour(colour.r), sh_from_colour(colour.g),
                                    sh_from_colour(colour.b)};
}

}  // namespace

bool is_compressed_ply(const PlyHeader& header) {
  const PlyElement* vertex = header.find("vertex");
  return header.find("chunk") && vertex && vertex->find("packed_position");
}

GaussianCloud read_compressed_ply(const ByteSource& file, const PlyHeader& header,
                                  const LoadContext& context, const glm::dvec3& origin) {
  const Layout layout = find_layout(file, header);
  const int degree = require_consistent(file, header, layout);
  GaussianCloud cloud;
  cloud.resize(layout.vertex->count, degree);
  cloud.model = header.statements.model.value_or(SplatModel::standard);

  const auto rows_of = [&](const PlyElement& element, std::size_t begin, std::size_t end) {
    return read_rows(file, element.data_offset, element.row_bytes, {}, begin, end);
  };
  const std::size_t rest = cloud.sh_count() - 1;
  context.for_blocks(
      cloud.size(), block_chunks * chunk_size, [&](std::size_t begin, std::size_t end) {
        const std::size_t first_chunk = begin / chunk_size;
        const auto chunks =
            rows_of(*layout.chunk, first_chunk, (end + chunk_size - 1) / chunk_size);
        const auto vertices = rows_of(*layout.vertex, begin, end);
        for (std::size_t i = begin; i < end; ++i)
          store(layout, chunks.data() + (i / chunk_size - first_chunk) * layout.chunk->row_bytes,
                vertices.data() + (i - begin) * layout.vertex->row_bytes, origin, cloud, i);
        if (rest == 0) return;
        const auto sh_rows = rows_of(*layout.sh, begin, end);
        for (std::size_t i = begin; i < end; ++i) {
          const std::byte* row = sh_rows.data() + (i - begin) * layout.sh->row_bytes;
          glm::vec3* sh = cloud.sh.data() + i * cloud.sh_count() + 1;
          for (std::size_t k = 0; k < rest; ++k)
            for (std::size_t c = 0; c < 3; ++c)
              sh[k][static_cast<int>(c)] = unpack_sh(row[layout.rest[c * rest + k]]);
        }
      });
  return cloud;
}

}  // namespace catgs

#include "render_core/scene/formats/spz.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include <fmt/format.h>
#include <glm/gtc/packing.hpp>

#include "render_core/base/error.h"
#include "render_core/scene/activations.h"
#include "render_core/scene/formats/axes.h"
#include "render_core/scene/formats/decompress.h"
#include "render_core/scene/formats/format_limits.h"
#include "render_core/scene/formats/spz_format.h"
#include "render_core/scene/transform.h"

namespace catgs {

namespace {

using namespace spz;

constexpr std::size_t max_extension_bytes = 64 * 1024;

struct Header {
  std::uint32_t version = 0;
  std::uint32_t count = 0;
  int sh_degree = 0;
  int fractional_bits = 0;
  bool antialiased = false, has_extensions = false;
  std::uint8_t unknown_flags = 0;
};

/// One attribute of all Gaussians: bytes per Gaussian in the file, and the function that stores
/// them.
struct Attribute {
  const char* name;
  std::size_t bytes;
  std::function<void(const std::byte* from, GaussianCloud& cloud, std::size_t i)> store;
};

std::uint8_t byte_at(const std::byte* from, std::size_t at) {
  return std::to_integer<std::uint8_t>(from[at]);
}

float fixed24(const std::byte* from, float unit_length) {
  const std::uint32_t bits = std::uint32_t{byte_at(from, 0)} << 8 |
                             std::uint32_t{byte_at(from, 1)} << 16 |
                             std::uint32_t{byte_at(from, 2)} << 24;
  return static_cast<float>(static_cast<std::int32_t>(bits) >> 8) * unit_length;
}

Attribute position_attribute(const Header& header) {
  if (header.version == 1)
    return {"positions", 6, [](const std::byte* from, GaussianCloud& cloud, std::size_t i) {
              for (int k = 0; k < 3; ++k)
                cloud.mean[i][k] = glm::unpackHalf1x16(load_as<std::uint16_t>(from + 2 * k));
            }};
  const float unit_length = std::ldexp(1.0f, -header.fractional_bits);
  return {"positions", 9, [=](const std::byte* from, GaussianCloud& cloud, std::size_t i) {
            for (int k = 0; k < 3; ++k) cloud.mean[i][k] = fixed24(from + 3 * k, unit_length);
          }};
}

/// Versions 1 and 2: x, y, z as bytes around 127.5, w from the unit length and not negative.
glm::quat first_three(const std::byte* from) {
  glm::vec3 v;
  for (int k = 0; k < 3; ++k) v[k] = static_cast<float>(byte_at(from, k)) / 127.5f - 1.0f;
  return {std::sqrt(std::max(0.0f, 1.0f - glm::dot(v, v))), v.x, v.y, v.z};
}

/// From version 3 on. Two bits name the largest of x, y, z, w, which is not negative and not
/// stored. The others, last one in the lowest bits, are a sign and 9 bits up to sqrt(1/2).
glm::quat smallest_three(const std::byte* from) {
  auto bits = load_as<std::uint32_t>(from);
  const int largest = static_cast<int>(bits >> 30);
  std::array<float, 4> xyzw{};
  float squares = 0.0f;
  for (int k = 3; k >= 0; --k) {
    if (k == largest) continue;
    const float value = static_cast<float>(bits & max_magnitude) * magnitude_unit;
    xyzw[static_cast<std::size_t>(k)] = bits & (max_magnitude + 1) ? -value : value;
    squares += value * value;
    bits >>= 10;
  }
  xyzw[static_cast<std::size_t>(largest)] = std::sqrt(std::max(0.0f, 1.0f - squares));
  return {xyzw[3], xyzw[0], xyzw[1], xyzw[2]};
}

Attribute rotation_attribute(const Header& header) {
  const bool old = header.version < 3;
  return {"rotations", old ? 3u : 4u,
          [=](const std::byte* from, GaussianCloud& cloud, std::size_t i) {
            cloud.rotation[i] = unit(old ? first_three(from) : smallest_three(from));
          }};
}

/// The attributes in the order of the file.
std::vector<Attribute> attributes(const Header& header) {
  std::vector<Attribute> all;
  all.push_back(position_attribute(header));
  all.push_back({"alphas", 1, [](const std::byte* from, GaussianCloud& cloud, std::size_t i) {
                   cloud.opacity[i] = opacity_from_byte(byte_at(from, 0));
                 }});
  all.push_back({"colors", 3, [](const std::byte* from, GaussianCloud& cloud, std::size_t i) {
                   glm::vec3& sh = cloud.sh[i * cloud.sh_count()];
                   for (int k = 0; k < 3; ++k)
                     sh[k] = (static_cast<float>(byte_at(from, k)) / 255.0f - 0.5f) / colour_scale;
                 }});
  all.push_back({"scales", 3, [](const std::byte* from, GaussianCloud& cloud, std::size_t i) {
                   for (int k = 0; k < 3; ++k)
                     cloud.scale[i][k] = std::exp(
                         static_cast<float>(byte_at(from, k)) / log_scale_steps + least_log_scale);
                 }});
  all.push_back(rotation_attribute(header));
  const std::size_t rest = static_cast<std::size_t>(sh_coefficient_count(header.sh_degree)) - 1;
  if (rest > 0)
    all.push_back({"sh", 3 * rest, [](const std::byte* from, GaussianCloud& cloud, std::size_t i) {
                     glm::vec3* sh = cloud.sh.data() + i * cloud.sh_count();
                     for (int k = 1; k < cloud.sh_count(); ++k, from += 3)
                       for (int c = 0; c < 3; ++c)
                         sh[k][c] = (static_cast<float>(byte_at(from, c)) - 128.0f) / 128.0f;
                   }});
  return all;
}

constexpr std::size_t block_bytes = 128 * 1024;

void read_attribute(ByteStream& stream, const Attribute& attribute, GaussianCloud& cloud,
                    const std::function<void()>& after_block) {
  const std::size_t rows = std::max<std::size_t>(1, block_bytes / attribute.bytes);
  std::vector<std::byte> block(rows * attribute.bytes);
  for (std::size_t begin = 0; begin < cloud.size(); begin += rows) {
    const std::size_t end = std::min(cloud.size(), begin + rows);
    stream.read(std::span(block).first((end - begin) * attribute.bytes));
    for (std::size_t i = begin; i < end; ++i)
      attribute.store(block.data() + (i - begin) * attribute.bytes, cloud, i);
    after_block();
  }
}

[[noreturn]] void fail(const ByteSource& file, std::string_view where, std::string_view what) {
  throw InputError(file.name(), where, what, "not an .spz file, or a damaged one");
}

Header parse_header(const ByteSource& file, std::span<const std::byte> bytes) {
  Header header;
  header.version = load_as<std::uint32_t>(bytes.data() + 4);
  header.count = load_as<std::uint32_t>(bytes.data() + 8);
  header.sh_degree = byte_at(bytes.data(), 12);
  header.fractional_bits = byte_at(bytes.data(), 13);
  header.antialiased = byte_at(bytes.data(), 14) & antialiased_flag;
  header.has_extensions = byte_at(bytes.data(), 14) & extensions_flag;
  header.unknown_flags =
      static_cast<std::uint8_t>(byte_at(bytes.data(), 14) & ~(antialiased_flag | extensions_flag));
  if (load_as<std::uint32_t>(bytes.data()) != magic) fail(file, "magic", "is not 'NGSP'");
  if (header.version < 1 || header.version > 4)
    throw InputError(file.name(), "version",
                     fmt::format("{} is not supported; 1 to 4 are", header.version));
  if (header.sh_degree > 4)
    fail(file, "shDegree", fmt::format("{} is not in 0…4", header.sh_degree));
  if (header.fractional_bits > 23)
    fail(file, "fractionalBits", fmt::format("{} is not in 0…23", header.fractional_bits));
  std::size_t plain_bytes = 0;
  for (const Attribute& attribute : attributes(header)) plain_bytes += attribute.bytes;
  require_plausible_count(file, "numPoints", header.count, plain_bytes, file.size());
  return header;
}

/// The contents of the extension records.
struct Extensions {
  std::optional<std::uint32_t> system{};  // if they name one
  std::optional<OrbitLimits> orbit{};
  std::vector<std::string> notes{};
};

std::optional<std::uint32_t> parse_system(const ByteSource& file,
                                          std::span<const std::byte> payload) {
  const auto system = payload.size() >= 4 ? load_as<std::uint32_t>(payload.data()) : 0;
  if (system > last_system)
    throw InputError(file.name(), "extension SPZ_ADOBE_coordinate_system",
                     fmt::format("coordinate system {} is not in 1…{}", system, last_system));
  if (system == 0) return std::nullopt;  // unspecified
  return system;
}

/// An orbit that makes no sense, or leaves no room as zeros do, is none. The scene does not need
/// it.
std::optional<OrbitLimits> parse_orbit(std::span<const std::byte> payload) {
  if (payload.size() < 3 * sizeof(float)) return std::nullopt;
  const auto number = [&](std::size_t i) { return load_as<float>(payload.data() + 4 * i); };
  for (std::size_t i = 0; i < 3; ++i)
    if (!std::isfinite(number(i))) return std::nullopt;
  constexpr float quarter_turn = 1.57079633f;
  const OrbitLimits orbit{std::clamp(number(0), -quarter_turn, quarter_turn),
                          std::clamp(number(1), -quarter_turn, quarter_turn),
                          std::clamp(number(2), 0.0f, 1e6f)};
  if (!(orbit.min_elevation < orbit.max_elevation)) return std::nullopt;
  return orbit;
}

/// `records`: u32 type, u32 length, payload. Of several of a type the first one counts.
Extensions parse_extensions(const ByteSource& file, std::span<const std::byte> records) {
  Extensions extensions;
  bool system_read = false;
  while (records.size() >= 8) {
    const auto type = load_as<std::uint32_t>(records.data());
    const auto length = load_as<std::uint32_t>(records.data() + 4);
    records = records.subspan(8);
    if (length > records.size())
      fail(file, fmt::format("extension {:#x}", type), "is longer than the space for extensions");
    const auto payload = records.first(length);
    records = records.subspan(length);
    if (type == coordinate_system_extension) {
      if (!std::exchange(system_read, true)) extensions.system = parse_system(file, payload);
    } else if (type == safe_orbit_extension) {
      if (!extensions.orbit) extensions.orbit = parse_orbit(payload);
    } else if (type != 0) {
      add_note(extensions.notes, fmt::format("its extension {:#x} is not known", type));
    }
  }
  return extensions;
}

/// Turns the cloud from a coordinate system to right, down, front.
void turn(std::uint32_t system, GaussianCloud& cloud, const LoadContext& context) {
  if (system >= first_z_up_system) {
    const CloudTransform transform({z_up_to_right_down_front(system), {}});
    context.for_blocks(cloud.size(), 1024, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) transform.apply(cloud, i);
    });
    return;
  }
  const AxisFlip flip(signs_to_right_down_front(system));
  const std::size_t sh_count = cloud.sh_count();
  context.for_blocks(cloud.size(), 1024, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      cloud.mean[i] = flip.mean(cloud.mean[i]);
      cloud.rotation[i] = flip.rotation(cloud.rotation[i]);
      for (std::size_t k = 1; k < sh_count; ++k) cloud.sh[i * sh_count + k] *= flip.sh(k);
    }
  });
}

SpzFile make_file(const Header& header) {
  SpzFile file{static_cast<int>(header.version), header.sh_degree, {}};
  file.cloud.resize(header.count, std::min(header.sh_degree, max_sh_degree));
  if (header.antialiased) file.cloud.model = SplatModel::antialiased;
  if (header.unknown_flags)
    add_note(file.notes, fmt::format("its flags {:#x} are not known; one may name a model, which "
                                     "--model or the sidecar's \"model\" can do",
                                     header.unknown_flags));
  return file;
}

/// Takes what the extensions say.
void finish(SpzFile& file, Extensions extensions, SpzAxes axes, const LoadContext& context) {
  file.orbit = extensions.orbit;
  for (const std::string& note : extensions.notes) add_note(file.notes, note);
  if (axes == SpzAxes::as_stored) return;
  turn(extensions.system.value_or(right_up_back_system), file.cloud, context);
  file.names_axes = extensions.system.has_value();
  if (file.names_axes) return;
  add_note(
      file.notes,
      "it does not name its axes, so y points up, as SPZ has it. splat-transform 3, Spark and "
      "spz-js do not turn the axes: a scene of theirs stands on its head, until --up=+y or the "
      "sidecar's \"up\": \"+y\" turns it");
  if (file.version == 2 && file.cloud.model == SplatModel::antialiased)
    add_note(file.notes,
             "it says that it is antialiased, as Spark 2.2 says of every scene; --model "
             "or the sidecar's \"model\" says otherwise");
}

/// Versions 1 to 3: one gzip stream, which tells the axes only at its end.
SpzFile read_gzip(const ByteSource& file, const LoadContext& context, SpzAxes axes) {
  const auto stream = open_gzip(file);
  std::array<std::byte, gzip_header_bytes> start;
  stream->read(start);
  const Header header = parse_header(file, start);
  if (header.version > 3) fail(file, "version", "4 in a gzip stream");

  SpzFile result = make_file(header);
  const LoadContext decoding = context.part(0.0, 0.9);
  for (const Attribute& attribute : attributes(header))
    read_attribute(*stream, attribute, result.cloud, [&] {
      decoding.report(static_cast<double>(stream->consumed()) / static_cast<double>(file.size()));
    });
  std::vector<std::byte> extensions(header.has_extensions ? max_extension_bytes : 0);
  const auto stored = std::span(extensions).first(stream->read_up_to(extensions));
  finish(result, parse_extensions(file, stored), axes, context.part(0.9, 1.0));
  return result;
}

/// Version 4: header, extensions, a table of (compressed, plain) sizes, one zstd stream per
/// attribute.
SpzFile read_plain(const ByteSource& file, const LoadContext& context, SpzAxes axes) {
  std::array<std::byte, plain_header_bytes> start;
  file.read(0, start);
  const Header header = parse_header(file, start);
  if (header.version < 4)
    fail(file, "version", fmt::format("{} outside of a gzip stream", header.version));
  const std::size_t stream_count = byte_at(start.data(), 15);
  const auto table_offset = load_as<std::uint32_t>(start.data() + 16);
  const std::vector<Attribute> all = attributes(header);
  if (stream_count != all.size())
    fail(file, "numStreams", fmt::format("{} where {} are expected", stream_count, all.size()));
  if (table_offset < plain_header_bytes || table_offset - plain_header_bytes > max_extension_bytes)
    fail(file, "tocByteOffset", fmt::format("{} is out of range", table_offset));

  std::vector<std::byte> extensions(table_offset - plain_header_bytes);
  file.read(plain_header_bytes, extensions);
  Extensions said = header.has_extensions ? parse_extensions(file, extensions) : Extensions{};

  std::vector<std::array<std::uint64_t, 2>> sizes(all.size());
  file.read(table_offset, std::as_writable_bytes(std::span(sizes)));
  std::vector<std::uint64_t> offsets;
  std::uint64_t offset = table_offset + std::span(sizes).size_bytes();
  for (std::size_t a = 0; a < all.size(); ++a) {
    const auto [compressed, plain] = sizes[a];
    if (plain != std::uint64_t{header.count} * all[a].bytes || compressed > file.size() - offset)
      fail(file, fmt::format("size of the {} stream", all[a].name),
           fmt::format("{} bytes for {} are not possible", compressed, plain));
    offsets.push_back(offset);
    offset += compressed;
  }

  SpzFile result = make_file(header);
  context.part(0.0, 0.9).for_blocks(all.size(), 1, [&](std::size_t a, std::size_t) {
    read_attribute(*open_zstd(file, offsets[a], sizes[a][0]), all[a], result.cloud, [] {});
  });
  finish(result, std::move(said), axes, context.part(0.9, 1.0));
  return result;
}

bool is_gzip(const ByteSource& file) { return begins_with(file, "\x1f\x8b"); }

}  // namespace

bool is_spz(const ByteSource& file) { return begins_with(file, "NGSP") || is_gzip(file); }

SceneSize read_spz_size(const ByteSource& file) {
  std::array<std::byte, plain_header_bytes> start;
  if (is_gzip(file))
    open_gzip(file)->read(std::span(start).first(gzip_header_bytes));
  else
    file.read(0, start);
  const Header header = parse_header(file, start);
  return {header.count, header.sh_degree};
}

SpzFile read_spz(const ByteSource& file, const LoadContext& context, SpzAxes axes) {
  return is_gzip(file) ? read_gzip(file, context, axes) : read_plain(file, context, axes);
}

constexpr SceneFormat spz_format = {
    .name = "SPZ",
    .extensions = {".spz"},
    .keeps_antialiased = true,
    .is_mine = [](const ByteSource& file, std::string_view) { return is_spz(file); },
    .size = [](const SceneFiles& files) { return read_spz_size(FileSource(files.path)); },
    .read = [](const SceneFiles& files, const LoadContext& context) -> DecodedScene {
      SpzFile spz = read_spz(FileSource(files.path), context);
      for (const std::string& note : notes_of_degree(spz.sh_degree)) add_note(spz.notes, note);
      return {fmt::format("spz v{}", spz.version),
              std::move(spz.cloud),
              std::move(spz.notes),
              spz.orbit,
              glm::dvec3(0.0),
              spz.names_axes ? UsualUp::minus_y : UsualUp::either_y};
    },
    .write = [](const GaussianCloud& cloud, const glm::dvec3&, ThreadPool&,
                std::ostream& to) { write_spz(cloud, to); },
    .losses = spz_losses,
};

}  // namespace catgs

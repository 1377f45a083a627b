#include "render_core/scene/formats/ply.h"

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "render_core/base/error.h"
#include "render_core/scene/activations.h"
#include "render_core/scene/formats/compressed_ply.h"
#include "render_core/scene/formats/format_limits.h"
#include "render_core/scene/formats/scene_format.h"
#include "render_core/scene/transform.h"

namespace catgs {

namespace {

constexpr int max_rest = 3 * (sh_coefficient_count(max_sh_degree) - 1);

/// One Gaussian as the file stores it, in one order whatever the file's.
struct Row {
  std::array<float, 3> mean, dc, log_scale;
  std::array<float, 4> rotation;  // w, x, y, z
  float opacity_logit;
  std::array<float, max_rest> rest;  // channel-major: all of red, all of green, all of blue
};
static_assert(sizeof(Row) == sizeof(float) * (14 + max_rest));
constexpr std::size_t row_fields = sizeof(Row) / sizeof(float);

/// The source of a field of Row.
struct Field {
  std::size_t destination;  // float of Row
  std::size_t property;     // of the element
};

struct Layout {
  int sh_degree = 0;
  std::vector<Field> fields;
  float colour_unit = 0.0f;               // of red, green, blue in place of f_dc; 0: there are f_dc
  std::array<std::size_t, 3> position{};  // properties x, y, z
};

std::size_t require_property(const ByteSource& file, const PlyElement& vertex,
                             const std::string& name) {
  const PlyProperty* property = vertex.find(name);
  if (!property)
    throw InputError(file.name(), "property " + name, "is missing in element vertex",
                     "only Gaussian Splatting point clouds can be rendered");
  if (property->is_list)
    throw InputError(file.name(), "property " + name, "is a list where a number is expected");
  return static_cast<std::size_t>(property - vertex.properties.data());
}

bool is_of_surfels(const PlyElement& vertex) { return vertex.find("scale_2") == nullptr; }

/// The names of red, green and blue. nerfstudio writes the first for scenes without harmonics.
std::array<std::string, 3> colour_names(const PlyElement& vertex) {
  const std::array<std::array<std::string, 3>, 3> known = {
      {{"red", "green", "blue"},
       {"r", "g", "b"},
       {"diffuse_red", "diffuse_green", "diffuse_blue"}}};
  if (!vertex.find("f_dc_0"))
    for (const auto& names : known)
      if (vertex.find(names[0])) return names;
  return {"f_dc_0", "f_dc_1", "f_dc_2"};
}

/// The value of a colour's property that stands for 1.
float full_colour(PlyType type) {
  if (type == PlyType::f32 || type == PlyType::f64) return 1.0f;
  return byte_size(type) == 2 ? 65535.0f : 255.0f;
}

Layout find_fields(const ByteSource& file, const PlyElement& vertex) {
  const std::size_t rest = vertex.rest_count();
  const int file_degree = rest % 3 == 0 ? sh_degree_of_rest(rest / 3) : -1;
  if (file_degree < 0)
    throw InputError(file.name(), "property f_rest_*",
                     fmt::format("{} of them; SH of degree 0, 1, 2, 3 has 0, 9, 24, 45", rest));

  Layout layout;
  layout.sh_degree = std::min(file_degree, max_sh_degree);
  const auto add = [&](std::size_t destination, const std::string& name) {
    layout.fields.push_back({destination, require_property(file, vertex, name)});
  };
  const auto at = [](std::size_t offset_bytes) { return offset_bytes / sizeof(float); };
  const std::array<std::string, 3> colours = colour_names(vertex);
  if (!colours[0].starts_with("f_"))
    layout.colour_unit = 1.0f / full_colour(vertex.find(colours[0])->type);
  for (std::size_t k = 0; k < 3; ++k) {
    add(at(offsetof(Row, mean)) + k, std::string(1, "xyz"[k]));
    layout.position[k] = layout.fields.back().property;
    add(at(offsetof(Row, dc)) + k, colours[k]);
    if (k < 2 || !is_of_surfels(vertex))
      add(at(offsetof(Row, log_scale)) + k, fmt::format("scale_{}", k));
  }
  for (std::size_t k = 0; k < 4; ++k)
    add(at(offsetof(Row, rotation)) + k, fmt::format("rot_{}", k));
  add(at(offsetof(Row, opacity_logit)), "opacity");
  const std::size_t kept = sh_coefficient_count(layout.sh_degree) - 1;
  for (std::size_t channel = 0; channel < 3; ++channel)
    for (std::size_t k = 0; k < kept; ++k)
      add(at(offsetof(Row, rest)) + channel * kept + k,
          fmt::format("f_rest_{}", channel * (rest / 3) + k));
  return layout;
}

SplatModel model_of(const PlyHeader& header, const PlyElement& vertex) {
  if (is_of_surfels(vertex)) return SplatModel::surfels;
  return header.statements.model.value_or(SplatModel::standard);
}

void store(const Row& row, const Layout& layout, GaussianCloud& cloud, std::size_t i) {
  cloud.mean[i] = {row.mean[0], row.mean[1], row.mean[2]};
  cloud.rotation[i] =
      unit(glm::quat(row.rotation[0], row.rotation[1], row.rotation[2], row.rotation[3]));
  cloud.scale[i] = exp(glm::vec3(row.log_scale[0], row.log_scale[1], row.log_scale[2]));
  cloud.opacity[i] = opacity_from_logit(row.opacity_logit);
  const std::size_t rest = cloud.sh_count() - 1;
  glm::vec3* sh = cloud.sh.data() + i * cloud.sh_count();
  sh[0] = {row.dc[0], row.dc[1], row.dc[2]};
  if (layout.colour_unit > 0.0f)
    for (int k = 0; k < 3; ++k) sh[0][k] = sh_from_colour(layout.colour_unit * sh[0][k]);
  for (std::size_t k = 0; k < rest; ++k)
    sh[1 + k] = {row.rest[k], row.rest[rest + k], row.rest[2 * rest + k]};
}

template <class T>
double load_big_endian(const std::byte* from) {
  std::array<std::byte, sizeof(T)> swapped;
  std::reverse_copy(from, from + sizeof(T), swapped.begin());
  return static_cast<double>(std::bit_cast<T>(swapped));
}

double load_scalar(const std::byte* from, PlyType type, bool big_endian) {
  const auto load = [&]<class T>(T) {
    return big_endian ? load_big_endian<T>(from) : static_cast<double>(load_as<T>(from));
  };
  switch (type) {
    case PlyType::i8:
      return load(std::int8_t{});
    case PlyType::u8:
      return load(std::uint8_t{});
    case PlyType::i16:
      return load(std::int16_t{});
    case PlyType::u16:
      return load(std::uint16_t{});
    case PlyType::i32:
      return load(std::int32_t{});
    case PlyType::u32:
      return load(std::uint32_t{});
    case PlyType::f32:
      return load(float{});
    case PlyType::f64:
      return load(double{});
  }
  return 0.0;
}

/// Whether places are more exact than floats.
bool has_precise_positions(const PlyElement& vertex) {
  return std::ranges::any_of(std::array{"x", "y", "z"}, [&](const char* name) {
    const PlyProperty* property = vertex.find(name);
    return property && property->type != PlyType::f32;
  });
}

/// Rows per block: about 128 KiB, so that a block stays in the second-level cache.
std::size_t block_rows(std::size_t row_bytes) {
  return std::max<std::size_t>(1, 128 * 1024 / std::max<std::size_t>(1, row_bytes));
}

void read_binary(const ByteSource& file, const PlyElement& vertex, const Layout& layout,
                 bool big_endian, const FileRows& rows, const glm::dvec3& origin,
                 GaussianCloud& cloud, const LoadContext& context) {
  const bool plain =
      !big_endian && std::all_of(layout.fields.begin(), layout.fields.end(), [&](const Field& f) {
        return vertex.properties[f.property].type == PlyType::f32;
      });
  const auto decode_row = [&](const std::byte* from, float* row) {
    for (const Field& f : layout.fields) {
      const PlyProperty& p = vertex.properties[f.property];
      row[f.destination] =
          plain ? load_as<float>(from + p.offset)
                : static_cast<float>(load_scalar(from + p.offset, p.type, big_endian));
    }
  };
  const auto position_of = [&](const std::byte* from) {
    glm::dvec3 position;
    for (int k = 0; k < 3; ++k) {
      const PlyProperty& p = vertex.properties[layout.position[static_cast<std::size_t>(k)]];
      position[k] = load_scalar(from + p.offset, p.type, big_endian);
    }
    return position;
  };
  const bool moves = origin != glm::dvec3(0.0);
  context.for_blocks(cloud.size(), block_rows(vertex.row_bytes),
                     [&](std::size_t begin, std::size_t end) {
                       const std::vector<std::byte> bytes =
                           read_rows(file, vertex.data_offset, vertex.row_bytes, rows, begin, end);
                       std::array<float, row_fields> fields{};
                       for (std::size_t i = begin; i < end; ++i) {
                         const std::byte* from = bytes.data() + (i - begin) * vertex.row_bytes;
                         decode_row(from, fields.data());
                         store(std::bit_cast<Row>(fields), layout, cloud, i);
                         if (moves) cloud.mean[i] = glm::vec3(position_of(from) - origin);
                       }
                     });
}

/// Numbers of an ASCII file, one after the other, read through a bounded buffer.
class AsciiNumbers {
 public:
  AsciiNumbers(const ByteSource& file, std::uint64_t offset) : file_(file), next_read_(offset) {}

  double next() {
    while (at_ < end_ || next_read_ < file_.size()) {
      if (end_ - at_ < max_token) refill();
      while (at_ < end_ && is_space(buffer_[at_])) ++at_;
      if (end_ - at_ >= max_token || next_read_ == file_.size()) break;
    }
    double value = 0.0;
    const char* buffer_end = buffer_.data() + end_;
    // from_chars() knows no plus sign, which some programs write.
    if (end_ - at_ > 1 && buffer_[at_] == '+' && buffer_[at_ + 1] != '-') ++at_;
    const auto [last, error] = std::from_chars(buffer_.data() + at_, buffer_end, value);
    if (error == std::errc::invalid_argument || (last != buffer_end && !is_space(*last)))
      throw InputError(file_.name(), fmt::format("byte {}", next_read_ - (end_ - at_)),
                       at_ == end_ ? "the file ends inside the data" : "not a number");
    at_ = static_cast<std::size_t>(last - buffer_.data());
    return value;
  }

 private:
  static constexpr std::size_t max_token = 128;
  static bool is_space(char c) { return c == ' ' || c == '\n' || c == '\r' || c == '\t'; }

  void refill() {
    std::copy(buffer_.begin() + at_, buffer_.begin() + end_, buffer_.begin());
    end_ -= at_;
    at_ = 0;
    const auto more = std::min<std::uint64_t>(buffer_.size() - end_, file_.size() - next_read_);
    file_.read(next_read_, std::as_writable_bytes(std::span(buffer_).subspan(end_, more)));
    next_read_ += more;
    end_ += more;
  }

  const ByteSource& file_;
  std::uint64_t next_read_;
  std::vector<char> buffer_ = std::vector<char>(256 * 1024);
  std::size_t at_ = 0, end_ = 0;
};

void read_ascii(const ByteSource& file, const PlyHeader& header, const PlyElement& vertex,
                const Layout& layout, const glm::dvec3& origin, GaussianCloud& cloud,
                const LoadContext& context) {
  AsciiNumbers numbers(file, header.bytes);
  for (const PlyElement& before : header.elements) {
    if (&before == &vertex) break;
    if (before.properties.empty()) continue;
    for (std::uint64_t row = 0; row < before.count; ++row)
      for (const PlyProperty& property : before.properties)
        for (double left = property.is_list ? numbers.next() : 1.0; left > 0.0; --left)
          numbers.next();
  }
  std::vector<double> values(vertex.properties.size());
  std::array<float, row_fields> fields{};
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    for (double& value : values) value = numbers.next();
    for (int k = 0; k < 3; ++k) values[layout.position[static_cast<std::size_t>(k)]] -= origin[k];
    for (const Field& f : layout.fields)
      fields[f.destination] = static_cast<float>(values[f.property]);
    store(std::bit_cast<Row>(fields), layout, cloud, i);
    if (i % 65536 == 0) context.report(static_cast<double>(i) / static_cast<double>(cloud.size()));
  }
}

/// An ASCII row takes at least two bytes per value.
void require_ascii_rows(const ByteSource& file, const PlyHeader& header, const PlyElement& vertex) {
  const std::uint64_t least = 2 * vertex.properties.size();
  require_count(file, "element vertex", vertex.count);
  if (vertex.has_list) throw InputError(file.name(), "element vertex", "has a list property");
  if (vertex.count > (file.size() - header.bytes + 1) / least)
    throw InputError(file.name(), fmt::format("byte {}", file.size()),
                     fmt::format("the file ends here and is too short for the {} vertices that its "
                                 "header announces",
                                 vertex.count));
}

}  // namespace

GaussianCloud read_ply(const ByteSource& file, const PlyHeader& header, const LoadContext& context,
                       const glm::dvec3& origin) {
  const PlyElement* vertex = header.find("vertex");
  if (!vertex) throw InputError(file.name(), "header", "there is no element vertex");
  if (header.encoding != PlyEncoding::ascii) {
    require_rows_in_file(file, *vertex);
    return read_ply_rows(file, header, {0, vertex->count}, context, origin);
  }
  const Layout layout = find_fields(file, *vertex);
  require_ascii_rows(file, header, *vertex);
  GaussianCloud cloud;
  cloud.resize(vertex->count, layout.sh_degree);
  cloud.model = model_of(header, *vertex);
  read_ascii(file, header, *vertex, layout, origin, cloud, context);
  if (is_of_surfels(*vertex)) flatten(cloud);
  return cloud;
}

GaussianCloud read_ply_rows(const ByteSource& file, const PlyHeader& header, const FileRows& rows,
                            const LoadContext& context, const glm::dvec3& origin) {
  const PlyElement& vertex = *header.find("vertex");
  const Layout layout = find_fields(file, vertex);
  GaussianCloud cloud;
  cloud.resize(rows.count, layout.sh_degree);
  cloud.model = model_of(header, vertex);
  read_binary(file, vertex, layout, header.encoding == PlyEncoding::binary_big_endian, rows, origin,
              cloud, context);
  if (is_of_surfels(vertex)) flatten(cloud);
  return cloud;
}

namespace {

SceneSize size_of_ply(const SceneFiles& files) {
  const FileSource file(files.path);
  const PlyHeader header = read_ply_header(file);
  const PlyElement* vertex = header.find("vertex");
  if (!vertex) throw InputError(file.name(), "element vertex", "is missing");
  require_count(file, "element vertex", vertex->count);
  if (header.encoding != PlyEncoding::ascii && !vertex->has_list)
    require_rows_in_file(file, *vertex);
  const PlyElement* sh = is_compressed_ply(header) ? header.find("sh") : vertex;
  if (!sh) return {vertex->count, 0};
  return {vertex->count, std::max(0, sh_degree_of_rest(sh->rest_count() / 3))};
}

std::vector<std::string> notes_of(const PlyHeader& header) {
  std::vector<std::string> notes =
      notes_of_degree(sh_degree_of_rest(header.find("vertex")->rest_count() / 3));
  for (const std::string& note : header.statements.notes) add_note(notes, note);
  return notes;
}

DecodedScene read_any_ply(const SceneFiles& files, const LoadContext& context) {
  const FileSource file(files.path);
  const PlyHeader header = read_ply_header(file);
  if (is_compressed_ply(header))
    return read_about_origin([&](const glm::dvec3& origin) -> DecodedScene {
      return {"compressed ply", read_compressed_ply(file, header, context, origin),
              header.statements.notes};
    });
  const auto read = [&](const glm::dvec3& origin) -> DecodedScene {
    GaussianCloud cloud = read_ply(file, header, context, origin);
    return {.format = "3DGS ply",
            .cloud = std::move(cloud),
            .notes = notes_of(header),
            .usual_up = header.statements.usual_up};
  };
  const PlyElement* vertex = header.find("vertex");
  if (header.encoding == PlyEncoding::ascii) return read_about_origin(read);
  if (!vertex || !has_precise_positions(*vertex)) return read(glm::dvec3(0.0));
  require_rows_in_file(file, *vertex);
  const FileRows sample = even_sample(vertex->count);
  const glm::dvec3 origin =
      find_origin(read_ply_rows(file, header, sample, context.part(0.0, 0.0)).mean);
  DecodedScene scene = read(origin);
  scene.origin = origin;
  return scene;
}

std::optional<DecodedParts> ply_in_parts(const SceneFiles& files, std::uint64_t part_rows,
                                         std::uint64_t most, const LoadContext& context) {
  const auto file = std::make_shared<const FileSource>(files.path);
  const auto header = std::make_shared<const PlyHeader>(read_ply_header(*file));
  const PlyElement* vertex = header->find("vertex");
  if (!vertex || header->encoding == PlyEncoding::ascii || is_compressed_ply(*header))
    return std::nullopt;
  require_rows_in_file(*file, *vertex, most);
  const auto read = [=](const FileRows& rows, const glm::dvec3& origin,
                        const LoadContext& reading) {
    return read_ply_rows(*file, *header, rows, reading, origin);
  };
  DecodedParts parts =
      parts_of_rows("3DGS ply", vertex->count, part_rows, read, context, notes_of(*header));
  parts.usual_up = header->statements.usual_up;
  return parts;
}

}  // namespace

constexpr SceneFormat ply_format = {
    .name = "PLY",
    .extensions = {".ply"},
    .kinds = "3DGS or compressed",
    .keeps_antialiased = true,
    .keeps_surfels = true,
    .keeps_origin = true,
    .is_mine = [](const ByteSource& file, std::string_view) { return begins_with(file, "ply"); },
    .size = size_of_ply,
    .read = read_any_ply,
    .read_parts = ply_in_parts,
    .write = [](const GaussianCloud& cloud, const glm::dvec3& origin, ThreadPool&,
                std::ostream& to) { write_ply(cloud, to, origin); },
};

}  // namespace catgs

#include "render_core/scene/formats/lcc.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <string_view>
#include <utility>

#include <fmt/format.h>
#include <glm/common.hpp>
#include <nlohmann/json.hpp>

#include "render_core/base/error.h"
#include "render_core/scene/activations.h"
#include "render_core/scene/formats/axes.h"
#include "render_core/scene/formats/json_field.h"
#include "render_core/scene/formats/model_statements.h"
#include "render_core/scene/formats/scene_format.h"
#include "render_core/scene/transform.h"

namespace catgs {

namespace {

constexpr std::uint64_t max_lcc_bytes = 4 << 20;
constexpr std::uint64_t max_levels = 16;
constexpr std::size_t max_cells = std::size_t{1} << 16;
constexpr std::size_t cell_bytes = 4, level_bytes = 16;  // in index.bin
constexpr std::size_t row_bytes = 32, sh_row_bytes = 64;
constexpr const char* index_file = "index.bin";
constexpr const char* data_file = "data.bin";
constexpr const char* sh_file = "shcoef.bin";
constexpr const char* environment_file = "environment.bin";

struct Range {
  glm::vec3 min{0.0f}, max{1.0f};
  [[nodiscard]] glm::vec3 at(const glm::vec3& share) const { return glm::mix(min, max, share); }
};

/// The content of the .lcc.
struct Meta {
  std::size_t levels = 0;
  bool has_sh = false;
  Range scale, sh, environment_scale, environment_sh;
  ModelStatements statements;
};

std::optional<Range> range_of(const JsonField& attributes, std::string_view name) {
  for (std::size_t i = 0; i < attributes.size(); ++i)
    if (attributes[i].at("name").text() == name)
      return Range{attributes[i].at("min").vec3(), attributes[i].at("max").vec3()};
  return std::nullopt;
}

Meta parse_meta(const ByteSource& file) {
  const nlohmann::json document = read_json(file, max_lcc_bytes);
  const JsonField root(file.name(), document);
  Meta meta;
  meta.statements.read_members(document);
  if (const auto encoding = root.find("encoding"); encoding && encoding->text() != "COMPRESS")
    encoding->fail("is not supported", "COMPRESS is");
  const JsonField levels = root.at("totalLevel"), attributes = root.at("attributes");
  if (levels.count() < 1 || levels.count() > max_levels)
    levels.fail(fmt::format("is not in 1…{}", max_levels));
  meta.levels = levels.count();
  const auto scale = range_of(attributes, "scale"), sh = range_of(attributes, "shcoef");
  if (!scale) attributes.fail("have no 'scale'");
  meta.scale = *scale;
  meta.sh = sh.value_or(Range{});
  meta.environment_scale = range_of(attributes, "envscale").value_or(meta.scale);
  meta.environment_sh = range_of(attributes, "envshcoef").value_or(meta.sh);
  // Before version 4 nothing says it, and the ranges of a scene without harmonics are 0…1.
  const auto type = root.find("fileType");
  meta.has_sh = type ? type->text() != "Portable"
                     : sh && (sh->min != glm::vec3(0.0f) || sh->max != glm::vec3(1.0f));
  return meta;
}

/// Gaussians that follow each other in a file.
struct Run {
  std::uint64_t offset = 0, count = 0;  // bytes, Gaussians
};

struct Cells {
  DetailTree tree;
  std::vector<Run> runs;  // by node
};

/// The levels of a cell stand for each other, the coarsest one on top.
Cells read_cells(const ByteSource& file, const Meta& meta, std::uint64_t data_bytes) {
  const std::size_t bytes_each = cell_bytes + level_bytes * meta.levels;
  const std::vector<std::byte> bytes = file.read_all(max_cells * bytes_each);
  if (bytes.size() % bytes_each != 0)
    throw InputError(file.name(), fmt::format("byte {}", bytes.size()),
                     fmt::format("ends inside a cell: each has {} bytes", bytes_each));
  Cells cells;
  const std::size_t root = cells.tree.add({}, false);
  cells.runs.emplace_back();
  for (std::size_t cell = 0; cell < bytes.size(); cell += bytes_each) {
    std::size_t above = root;
    for (std::size_t level = meta.levels; level > 0; --level) {
      const std::size_t at = cell + cell_bytes + level_bytes * (level - 1);
      const auto count = load_as<std::int32_t>(&bytes[at]);
      const auto offset = load_as<std::int64_t>(&bytes[at + 4]);
      if (count == 0) continue;
      const Run run{static_cast<std::uint64_t>(offset), static_cast<std::uint64_t>(count)};
      if (count < 0 || run.offset > data_bytes || run.count > (data_bytes - run.offset) / row_bytes)
        throw InputError(
            file.name(), fmt::format("byte {}", at),
            fmt::format("{} Gaussians from byte {} on are not in {}", count, offset, data_file));
      above = cells.tree.add(above, false);
      cells.tree.add_gaussians(above, run.count);
      cells.runs.push_back(run);
    }
  }
  return cells;
}

/// Two bits name the largest of x, y, z, w; the others follow in order, the first one lowest.
glm::quat unpack_rotation(std::uint32_t packed) {
  const std::size_t largest = packed >> 30;
  std::array<float, 4> xyzw{};
  float squares = 0.0f;
  for (std::size_t k = 0; k < 4; ++k) {
    if (k == largest) continue;
    xyzw[k] = (static_cast<float>(packed & 1023) / 1023.0f - 0.5f) * 1.41421356f;
    squares += xyzw[k] * xyzw[k];
    packed >>= 10;
  }
  xyzw[largest] = std::sqrt(std::max(0.0f, 1.0f - squares));
  return unit(glm::quat(xyzw[3], xyzw[0], xyzw[1], xyzw[2]));
}

/// A row: mean, colour, scale, rotation, and a normal that is not read.
void store(const std::byte* row, const Range& scale, GaussianCloud& cloud, std::size_t i) {
  const auto byte = [&](std::size_t at) { return std::to_integer<std::uint8_t>(row[at]); };
  const auto share = [&](std::size_t at) {
    return static_cast<float>(load_as<std::uint16_t>(row + at)) / 65535.0f;
  };
  const auto colour = [&](std::size_t at) {
    return sh_from_colour(static_cast<float>(byte(at)) / 255.0f);
  };
  cloud.mean[i] = load_as<glm::vec3>(row);
  cloud.sh[i * static_cast<std::size_t>(cloud.sh_count())] = {colour(12), colour(13), colour(14)};
  cloud.opacity[i] = opacity_from_byte(byte(15));
  cloud.scale[i] = scale.at({share(16), share(18), share(20)});
  cloud.rotation[i] = unpack_rotation(load_as<std::uint32_t>(row + 22));
}

/// Fifteen words of 11, 10 and 11 bits.
void store_sh(const std::byte* row, const Range& range, GaussianCloud& cloud, std::size_t i) {
  glm::vec3* sh = &cloud.sh[i * static_cast<std::size_t>(cloud.sh_count())] + 1;
  for (std::size_t k = 0; k < 15; ++k) {
    const auto word = load_as<std::uint32_t>(row + 4 * k);
    sh[k] = range.at({static_cast<float>(word & 2047) / 2047.0f,
                      static_cast<float>(word >> 11 & 1023) / 1023.0f,
                      static_cast<float>(word >> 21) / 2047.0f});
  }
}

/// Where rows are, and how far the next one is.
struct Table {
  std::shared_ptr<const ByteSource> file;
  std::uint64_t offset = 0;
  std::size_t stride = 0;
};

struct Part {
  std::uint64_t count = 0;
  Table rows, sh;  // sh: without a file, there are none
  Range scale, sh_range;
};

GaussianCloud read_part(const Part& part, int sh_degree, const glm::dvec3& origin,
                        const LoadContext& context) {
  GaussianCloud cloud;
  cloud.resize(part.count, sh_degree);
  const CloudTransform transform({quarter_turn_about_x, -origin});
  context.for_blocks(part.count, 4096, [&](std::size_t begin, std::size_t end) {
    const auto bytes_of = [&](const Table& table, std::size_t used) {
      std::vector<std::byte> bytes((end - begin - 1) * table.stride + used);
      table.file->read(table.offset + begin * table.stride, bytes);
      return bytes;
    };
    const std::vector<std::byte> rows = bytes_of(part.rows, row_bytes);
    const std::vector<std::byte> sh =
        part.sh.file ? bytes_of(part.sh, sh_row_bytes) : std::vector<std::byte>();
    for (std::size_t i = begin; i < end; ++i) {
      store(&rows[(i - begin) * part.rows.stride], part.scale, cloud, i);
      if (!sh.empty()) store_sh(&sh[(i - begin) * part.sh.stride], part.sh_range, cloud, i);
      transform.apply(cloud, i);
    }
  });
  return cloud;
}

/// Nothing where the file is missing: a scene may do without.
std::optional<Part> open_environment(const FileSet& files, const Meta& meta) {
  std::shared_ptr<const ByteSource> file;
  try {
    file = files.open(environment_file);
  } catch (const InputError&) {
    return std::nullopt;
  }
  const std::size_t stride = row_bytes + (meta.has_sh ? sh_row_bytes : 0);
  if (file->size() % stride != 0)
    throw InputError(file->name(), fmt::format("byte {}", file->size()),
                     fmt::format("ends inside a Gaussian: each has {} bytes", stride));
  Part part{
      file->size() / stride, {file, 0, stride}, {}, meta.environment_scale, meta.environment_sh};
  if (meta.has_sh) part.sh = {file, row_bytes, stride};
  return part.count > 0 ? std::optional(part) : std::nullopt;
}

/// Two of the files may be missing.
std::vector<std::string> lcc_files(const ByteSource& file) {
  std::vector<std::string> names = {index_file, data_file};
  for (const char* name : {sh_file, environment_file}) {
    std::error_code error;
    if (std::filesystem::exists(std::filesystem::path(file.name()).parent_path() / name, error))
      names.emplace_back(name);
  }
  return names;
}

}  // namespace

OpenLevels open_lcc(const std::shared_ptr<const FileSet>& folder, const std::string& index,
                    std::optional<int> level, std::optional<std::size_t> budget,
                    std::uint64_t most) {
  const auto file = folder->open(index);
  const Meta meta = parse_meta(*file);
  const std::shared_ptr<const ByteSource> data = folder->open(data_file);
  const std::shared_ptr<const ByteSource> sh = meta.has_sh ? folder->open(sh_file) : nullptr;
  const Cells cells = read_cells(*folder->open(index_file), meta, data->size());
  const auto environment = open_environment(*folder, meta);
  const std::uint64_t always = environment ? environment->count : 0;
  const DetailChoice choice = choose_detail(cells.tree, file->name(), level, budget, always);
  if (choice.count == 0) throw InputError(file->name(), "", "holds no Gaussians");
  if (choice.count > data->size() / row_bytes)
    throw InputError(file->name(), "", fmt::format("cells share Gaussians of {}", data_file));

  OpenLevels scene;
  scene.format = fmt::format("LCC ({})", choice.text);
  scene.levels = cells.tree.levels();
  scene.sh_degree = meta.has_sh ? max_sh_degree : 0;
  scene.count = choice.count + always;
  scene.notes = meta.statements.notes;
  require_count(*file, "", scene.count, most);
  auto parts = std::make_shared<std::vector<Part>>();
  for (const std::size_t node : choice.nodes) {
    const Run& run = cells.runs[node];
    if (run.count == 0) continue;
    Part part{run.count, {data, run.offset, row_bytes}, {}, meta.scale, meta.sh};
    if (sh) part.sh = {sh, run.offset / row_bytes * sh_row_bytes, sh_row_bytes};
    parts->push_back(std::move(part));
  }
  if (environment) parts->push_back(*environment);
  scene.parts = parts->size();
  scene.read = [folder, parts, degree = scene.sh_degree, model = meta.statements.model](
                   std::size_t part, const glm::dvec3& origin, const LoadContext& context) {
    GaussianCloud cloud = read_part((*parts)[part], degree, origin, context);
    cloud.model = model.value_or(cloud.model);
    return cloud;
  };
  return scene;
}

constexpr SceneFormat lcc_format = {
    .name = "LCC",
    .extensions = {".lcc"},
    .names_folder = true,
    .is_mine = [](const ByteSource&, std::string_view extension) { return extension == ".lcc"; },
    .files_beside = lcc_files,
    .open_levels = open_lcc,
};

}  // namespace catgs

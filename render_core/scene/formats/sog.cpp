#include "render_core/scene/formats/sog.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <filesystem>
#include <functional>
#include <map>

#include <fmt/format.h>
#include <glm/common.hpp>
#include <nlohmann/json.hpp>

#include "render_core/base/error.h"
#include "render_core/scene/activations.h"
#include "render_core/scene/formats/format_limits.h"
#include "render_core/scene/formats/json_field.h"
#include "render_core/scene/formats/model_statements.h"
#include "render_core/scene/formats/scene_format.h"
#include "render_core/scene/formats/sog_image.h"

namespace catgs {

namespace {

constexpr std::uint64_t max_meta_bytes = 4 << 20;
constexpr std::size_t palette_row = 64;       // palette entries in a row of its image
constexpr std::uint64_t max_palette = 65536;  // labels have 16 bits
constexpr int first_quat_tag = 252;           // 252…255: w, x, y or z is the largest

SogMeta::Channel between(float min, float max) {
  SogMeta::Channel values;
  for (std::size_t byte = 0; byte < values.size(); ++byte)
    values[byte] = min + (max - min) * static_cast<float>(byte) / 255.0f;
  return values;
}

/// An early writer left out the first of the ascending values. The mean slope of
/// the others gives it.
SogMeta::Channel codebook(const JsonField& field) {
  SogMeta::Channel values{};
  if (field.size() != values.size()) field.fail("is not an array of 256 numbers");
  const bool first_missing = field[0].value().is_null();
  for (std::size_t i = first_missing ? 1 : 0; i < values.size(); ++i) values[i] = field[i].number();
  if (first_missing) values[0] = values[1] + (values[1] - values[255]) / 255.0f;
  return values;
}

std::string image_name(const JsonField& meta, const char* attribute, std::size_t index,
                       std::size_t expected) {
  const JsonField files = meta.at(attribute).at("files");
  if (files.size() != expected) files.fail(fmt::format("does not name {} images", expected));
  return files[index].text();
}

void parse_version_1(const JsonField& meta, SogMeta& sog) {
  const JsonField shape = meta.at("means").at("shape");
  if (shape.size() == 0) shape.fail("is empty");
  sog.count = shape[0].count();
  const auto min_scale = meta.at("scales").at("mins").vec3();
  const auto max_scale = meta.at("scales").at("maxs").vec3();
  const auto min_sh0 = meta.at("sh0").at("mins").numbers(4);
  const auto max_sh0 = meta.at("sh0").at("maxs").numbers(4);
  for (std::size_t k = 0; k < 3; ++k) {
    const int axis = static_cast<int>(k);
    sog.log_scale[k] = between(min_scale[axis], max_scale[axis]);
    sog.sh0[k] = between(min_sh0[k], max_sh0[k]);
  }
  sog.opacity = between(min_sh0[3], max_sh0[3]);
  for (float& value : sog.opacity) value = opacity_from_logit(value);
  if (const auto rest = meta.find("shN"))
    sog.sh_rest = between(rest->at("mins").number(), rest->at("maxs").number());
}

void parse_version_2(const JsonField& meta, SogMeta& sog) {
  sog.count = meta.at("count").count();
  sog.log_scale.fill(codebook(meta.at("scales").at("codebook")));
  sog.sh0.fill(codebook(meta.at("sh0").at("codebook")));
  for (std::size_t byte = 0; byte < sog.opacity.size(); ++byte)
    sog.opacity[byte] = opacity_from_byte(static_cast<unsigned char>(byte));
  if (const auto rest = meta.find("shN")) {
    sog.sh_rest = codebook(rest->at("codebook"));
    sog.palette_size = rest->at("count").count();
    const std::uint64_t degree = rest->at("bands").count();
    if (degree < 1 || degree > max_sh_degree) rest->at("bands").fail("is not in 1…3");
    sog.sh_degree = static_cast<int>(degree);
  }
}

/// Checks, before any image is decoded, that each has a texel per Gaussian and not many more. A
/// file named twice counts once, and bytes count only as far as the archive held them.
void check_image_sizes(const FileSet& files, const SogMeta& sog, const ByteSource& meta_file) {
  std::vector<std::string> images = {sog.means_low, sog.means_high, sog.quats, sog.scales,
                                     sog.sh0_image};
  if (!sog.labels.empty()) images.push_back(sog.labels);
  std::map<std::filesystem::path, std::uint64_t> bytes;
  for (const std::string& name : images) {
    const auto file = files.open(sog.folder + name);
    const SogImageSize size = sog_image_size(*file);
    bytes[std::filesystem::path(name).lexically_normal()] = file->size();
    if (size.texels() < sog.count || size.texels() > 2 * sog.count + 65536)
      throw InputError(
          file->name(), "size",
          fmt::format("{}x{} texels for {} Gaussians", size.width, size.height, sog.count));
  }
  std::uint64_t held = 0;
  for (const auto& [name, size] : bytes) held += size;
  require_plausible_count(meta_file, "count", sog.count, sog_texel_bytes * images.size(),
                          std::min(held, files.packed_bytes()));
}

/// The palette's image is 64 entries wide; its width is the only statement of version 1 about the
/// degree.
void check_palette(const FileSet& files, SogMeta& sog) {
  const auto file = files.open(sog.folder + sog.centroids);
  const SogImageSize size = sog_image_size(*file);
  const int degree =
      size.width % palette_row == 0 ? sh_degree_of_rest(size.width / palette_row) : -1;
  if (degree < 1 || degree > max_sh_degree || (sog.version == 2 && degree != sog.sh_degree))
    throw InputError(
        file->name(), "size",
        fmt::format("a palette {} texels wide does not fit SH of a degree in 1…3", size.width));
  sog.sh_degree = degree;
  const std::uint64_t held = std::uint64_t{palette_row} * size.height;
  if (sog.version == 1) sog.palette_size = std::min(held, max_palette);
  if (sog.palette_size > held) sog.palette_size = held;  // small scenes announce a full palette
  if (size.height > max_palette / palette_row)
    throw InputError(file->name(), "size", "the palette has more entries than labels can name");
}

struct Decoder {
  const FileSet& files;
  const SogMeta& meta;
  std::span<const SogRange> ranges;
  GaussianCloud& cloud;
  glm::dvec3 origin;

  /// The image, with `texels` or more. Sizes were checked when the meta data was read, but files of
  /// a folder may have been replaced since.
  [[nodiscard]] SogImage image(const std::string& name, std::size_t texels) const {
    const auto file = files.open(meta.folder + name);
    SogImage image = read_sog_image(*file);
    if (std::size_t{image.width} * image.height < texels)
      throw InputError(file->name(), "size", "the image was replaced while the scene was read",
                       "load it again");
    return image;
  }

  /// Calls store(texel index, index in the cloud) for every wanted Gaussian.
  template <class Store>
  void for_each(const Store& store) const {
    for (const SogRange& range : ranges)
      for (std::size_t k = 0; k < range.count; ++k) store(range.begin + k, range.destination + k);
  }

  /// 16 bits per axis between the limits of the logarithmic means, low and high bytes apart.
  void means() const {
    const auto mean_of = [this](const glm::dvec3& steps) {
      const glm::dvec3 v = glm::mix(meta.min_log_mean, meta.max_log_mean, steps / 65535.0);
      glm::dvec3 mean;
      for (int k = 0; k < 3; ++k) mean[k] = std::copysign(std::expm1(std::abs(v[k])), v[k]);
      return glm::vec3(mean - origin);
    };
    const SogImage low = image(meta.means_low, meta.count),
                   high = image(meta.means_high, meta.count);
    for_each([&](std::size_t from, std::size_t to) {
      const std::uint8_t *l = low.texel(from), *h = high.texel(from);
      cloud.mean[to] = mean_of({l[0] | h[0] << 8, l[1] | h[1] << 8, l[2] | h[2] << 8});
    });
  }

  void rotations() const {
    const SogImage quats = image(meta.quats, meta.count);
    for_each([&](std::size_t from, std::size_t to) {
      const std::uint8_t* texel = quats.texel(from);
      if (texel[3] < first_quat_tag) {  // no rotation stored; sanitize makes it the identity
        cloud.rotation[to] = glm::quat(0.0f, 0.0f, 0.0f, 0.0f);
        return;
      }
      const std::size_t largest = texel[3] - first_quat_tag;
      std::array<float, 4> wxyz{};
      float squares = 0.0f;
      for (std::size_t k = 0, stored = 0; k < 4; ++k) {
        if (k == largest) continue;
        wxyz[k] = (static_cast<float>(texel[stored++]) / 255.0f - 0.5f) * 1.41421356f;
        squares += wxyz[k] * wxyz[k];
      }
      wxyz[largest] = std::sqrt(std::max(0.0f, 1.0f - squares));
      cloud.rotation[to] = unit(glm::quat(wxyz[0], wxyz[1], wxyz[2], wxyz[3]));
    });
  }

  void scales() const {
    auto scale = meta.log_scale;
    for (auto& channel : scale)
      for (float& value : channel) value = std::exp(value);
    const SogImage scales = image(meta.scales, meta.count);
    for_each([&](std::size_t from, std::size_t to) {
      const std::uint8_t* texel = scales.texel(from);
      cloud.scale[to] = {scale[0][texel[0]], scale[1][texel[1]], scale[2][texel[2]]};
    });
  }

  void colours() const {
    const SogImage sh0 = image(meta.sh0_image, meta.count);
    const std::size_t stride = cloud.sh_count();
    for_each([&](std::size_t from, std::size_t to) {
      const std::uint8_t* texel = sh0.texel(from);
      cloud.sh[to * stride] = {meta.sh0[0][texel[0]], meta.sh0[1][texel[1]], meta.sh0[2][texel[2]]};
      cloud.opacity[to] = meta.opacity[texel[3]];
    });
  }

  /// Labels beyond the palette mean no view dependence.
  void rest() const {
    const std::size_t coefficients = sh_coefficient_count(meta.sh_degree) - 1;
    std::vector<glm::vec3> palette(meta.palette_size * coefficients);
    {
      const SogImage centroids = image(meta.centroids, palette.size());
      for (std::size_t i = 0; i < palette.size(); ++i) {  // rows of 64 entries follow each other
        const std::uint8_t* texel = centroids.texel(i);
        palette[i] = {meta.sh_rest[texel[0]], meta.sh_rest[texel[1]], meta.sh_rest[texel[2]]};
      }
    }
    const SogImage labels = image(meta.labels, meta.count);
    const std::size_t stride = cloud.sh_count();
    for_each([&](std::size_t from, std::size_t to) {
      const std::uint8_t* texel = labels.texel(from);
      const std::size_t label = texel[0] | texel[1] << 8;
      if (label < meta.palette_size)
        std::copy_n(palette.begin() + label * coefficients, coefficients,
                    cloud.sh.begin() + to * stride + 1);
    });
  }
};

SogMeta parse(const ByteSource& file, const std::string& name) {
  const nlohmann::json document = read_json(file, max_meta_bytes);
  const JsonField meta(file.name(), document);
  SogMeta sog;
  sog.folder = name.substr(0, name.rfind('/') + 1);
  const auto version = meta.find("version");
  sog.version = version ? static_cast<int>(std::min<std::uint64_t>(version->count(), 99)) : 1;
  if (sog.version == 1)
    parse_version_1(meta, sog);
  else if (sog.version == 2)
    parse_version_2(meta, sog);
  else
    version->fail("is not supported", "versions 1 and 2 are");

  ModelStatements statements;
  if (const auto model = meta.find("model")) static_cast<void>(model->text());
  statements.read_members(document);
  if (const auto asset = meta.find("asset")) statements.read_members(asset->value());
  sog.model = statements.model.value_or(SplatModel::standard);
  sog.notes = std::move(statements.notes);
  sog.min_log_mean = meta.at("means").at("mins").dvec3();
  sog.max_log_mean = meta.at("means").at("maxs").dvec3();
  sog.means_low = image_name(meta, "means", 0, 2);
  sog.means_high = image_name(meta, "means", 1, 2);
  sog.quats = image_name(meta, "quats", 0, 1);
  sog.scales = image_name(meta, "scales", 0, 1);
  sog.sh0_image = image_name(meta, "sh0", 0, 1);
  if (meta.find("shN")) {
    sog.centroids = image_name(meta, "shN", 0, 2);
    sog.labels = image_name(meta, "shN", 1, 2);
  }
  require_count(file, "count", sog.count);
  return sog;
}

}  // namespace

SogMeta parse_sog_meta(const FileSet& files, const std::string& name) {
  return parse(*files.open(name), name);
}

SogMeta read_sog_meta(const FileSet& files, const std::string& name) {
  const auto file = files.open(name);
  SogMeta sog = parse(*file, name);
  check_image_sizes(files, sog, *file);
  if (!sog.centroids.empty()) check_palette(files, sog);
  return sog;
}

void decode_sog(const FileSet& files, const SogMeta& meta, std::span<const SogRange> ranges,
                GaussianCloud& cloud, const LoadContext& context, const glm::dvec3& origin) {
  for ([[maybe_unused]] const SogRange& range : ranges) {
    assert(range.begin + range.count <= meta.count);
    assert(range.destination + range.count <= cloud.size());
  }
  cloud.model = meta.model;
  const Decoder decoder{files, meta, ranges, cloud, origin};
  // The longest step first, so that threads end together.
  std::vector<std::function<void()>> steps;
  if (meta.sh_degree > 0) steps.emplace_back([&] { decoder.rest(); });
  steps.emplace_back([&] { decoder.means(); });
  steps.emplace_back([&] { decoder.rotations(); });
  steps.emplace_back([&] { decoder.scales(); });
  steps.emplace_back([&] { decoder.colours(); });
  context.for_blocks(steps.size(), 1, [&](std::size_t i, std::size_t) { steps[i](); });
}

SogFile read_sog(const FileSet& files, const std::string& meta_name, const LoadContext& context) {
  const SogMeta meta = read_sog_meta(files, meta_name);
  SogFile sog{meta.version, {}, meta.notes, {}};
  sog.cloud.resize(meta.count, meta.sh_degree);
  const SogRange all{0, meta.count, 0};
  decode_sog(files, meta, {&all, 1}, sog.cloud, context);
  sog.origin = find_origin(sog.cloud.mean);
  if (sog.origin != glm::dvec3(0.0)) Decoder{files, meta, {&all, 1}, sog.cloud, sog.origin}.means();
  return sog;
}

namespace {

constexpr const char* index_name = "meta.json";

SceneSize size_of_sog(const SceneFiles& files) {
  const SogMeta meta = parse_sog_meta(*files.open(index_name), index_name);
  return {meta.count, meta.hides_sh_degree() ? max_sh_degree : meta.sh_degree};
}

DecodedScene read_sog_scene(const SceneFiles& files, const LoadContext& context) {
  SogFile sog = read_sog(*files.open(), index_name, context);
  return {fmt::format("sog v{} ({})", sog.version, files.index.empty() ? "zip" : "folder"),
          std::move(sog.cloud),
          std::move(sog.notes),
          {},
          sog.origin};
}

}  // namespace

constexpr SceneFormat sog_format = {
    .name = "SOG",
    .extensions = {".sog"},
    .index = index_name,
    .keeps_antialiased = true,
    .keeps_surfels = true,
    .is_mine = [](const ByteSource& file,
                  std::string_view) { return begins_with(file, "PK\x03\x04"); },
    .size = size_of_sog,
    .read = read_sog_scene,
    .write = [](const GaussianCloud& cloud, const glm::dvec3&, ThreadPool& pool,
                std::ostream& to) { write_sog(cloud, pool, to); },
    .losses = sog_losses,
};

}  // namespace catgs

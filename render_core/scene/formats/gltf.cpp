#include "render_core/scene/formats/gltf.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <string_view>

#include <fmt/format.h>
#include <glm/common.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/mat3x3.hpp>

#include "render_core/base/error.h"
#include "render_core/math/spherical_harmonics-inl.h"
#include "render_core/scene/activations.h"
#include "render_core/scene/copy_gaussians.h"
#include "render_core/scene/directions.h"
#include "render_core/scene/formats/format_limits.h"
#include "render_core/scene/formats/gltf_document.h"
#include "render_core/scene/formats/model_statements.h"
#include "render_core/scene/formats/scene_format.h"
#include "render_core/scene/formats/spz.h"
#include "render_core/scene/transform.h"

namespace catgs {

namespace {

constexpr std::size_t max_parts = 4096, max_primitives = 65'536;
constexpr std::string_view extension_name = "KHR_gaussian_splatting";
// The last two are drafts that may have no extension around them.
constexpr std::array<std::string_view, 4> spz_extension_names = {
    "KHR_gaussian_splatting_compression_spz_2", "KHR_gaussian_splatting_compression_spz",
    "KHR_spz_gaussian_splats_compression", "KHR_spz_compression"};

/// A primitive with Gaussians at a node.
struct Part {
  AffineMap map;            // to GaussianCloud's world
  std::uint64_t count = 0;  // Gaussians
  int sh_degree = 0;        // of the part as loaded
  GltfAccessor mean, rotation, scale, opacity;
  std::vector<GltfAccessor> sh;  // by coefficient
  bool is_draft = false;         // then `opacity` is of colours with alpha, and sh[0] is not there
  GltfBytes spz;                 // holds all of these, if it has a file
  bool linear_colours = false;
};

struct Contents {
  std::vector<Part> parts;
  std::size_t primitives = 0;  // at nodes, with Gaussians or without
  GltfSize size;
  ModelStatements statements;

  void note(std::string_view text) { add_note(statements.notes, text); }
};

/// Kinds of numbers that an attribute may have: any of these bits.
constexpr unsigned kind(GltfComponent component, bool normalized) {
  return 1u << (2 * (static_cast<int>(component) - static_cast<int>(GltfComponent::byte)) +
                (normalized ? 1 : 0));
}
constexpr unsigned floats = kind(GltfComponent::float32, false);
constexpr unsigned signed_fractions =
    kind(GltfComponent::byte, true) | kind(GltfComponent::short_int, true);
constexpr unsigned fractions =
    kind(GltfComponent::unsigned_byte, true) | kind(GltfComponent::unsigned_short, true);
constexpr unsigned counts =
    kind(GltfComponent::unsigned_byte, false) | kind(GltfComponent::unsigned_short, false);
constexpr unsigned signed_counts =
    kind(GltfComponent::byte, false) | kind(GltfComponent::short_int, false);

std::string attribute_name(std::string_view name) {
  return fmt::format("{}:{}", extension_name, name);
}

std::string sh_name(int degree, int k) { return fmt::format("SH_DEGREE_{}_COEF_{}", degree, k); }

/// Drafts of 2024 and 2025 name attributes of their own with an underscore, and have the diffuse
/// colour and the opacity in COLOR_0.
bool is_draft(const JsonField& attributes) {
  return attributes.find("_SCALE") && !attributes.find(attribute_name("SCALE"));
}

GltfAccessor attribute(GltfDocument& document, const JsonField& attributes, std::string_view name,
                       std::size_t columns, unsigned kinds) {
  const JsonField index = attributes.at(name);
  const GltfAccessor accessor = document.accessor(index);
  if (accessor.columns != columns)
    index.fail(fmt::format("is a table of {} columns, not {}", accessor.columns, columns));
  if (!(kinds & kind(accessor.component, accessor.normalized)))
    index.fail("has a component type that this attribute may not have");
  return accessor;
}

/// "ellipse" and the like: what we draw, whatever the file says.
void check_words(const JsonField& extension, Contents& contents) {
  const auto expect = [&](std::string_view key, std::string_view known) {
    const auto word = extension.find(key);
    if (word && word->text() != known)
      contents.note(fmt::format("{} '{}' is not known; drawn as '{}'", key, word->text(), known));
  };
  expect("kernel", "ellipse");
  expect("projection", "perspective");
  expect("sortingMethod", "cameraDistance");
}

bool has_linear_colours(const JsonField& space, Contents& contents) {
  if (space.text() == "srgb_rec709_display") return false;
  if (space.text() == "lin_rec709_display") {
    contents.note("its colours are linear light: they were encoded as sRGB, and are blended so");
    return true;
  }
  contents.note(
      fmt::format("colorSpace '{}' is not known; drawn as 'srgb_rec709_display'", space.text()));
  return false;
}

/// Drafts of the extension for .spz need neither `kernel` nor `colorSpace`, and the attributes are
/// those of the .spz.
Part parse_spz_part(GltfDocument& document, const JsonField& spz, const JsonField& extension,
                    Contents& contents) {
  Part part;
  part.spz = document.view(spz.at("bufferView"));
  const SceneSize size = read_spz_size(SliceSource(*part.spz.file, part.spz.offset, part.spz.size));
  part.count = size.gaussians;
  part.sh_degree = std::min(size.sh_degree, max_sh_degree);
  for (const std::string& note : notes_of_degree(size.sh_degree)) contents.note(note);
  if (const auto space = extension.find("colorSpace"))
    part.linear_colours = has_linear_colours(*space, contents);
  return part;
}

/// The extension for .spz, in its place or beside the extension for Gaussians.
std::optional<JsonField> spz_of(const JsonField& primitive) {
  const auto outer = primitive.find("extensions");
  const auto gaussians = outer ? outer->find(extension_name) : std::nullopt;
  const auto inner = gaussians ? gaussians->find("extensions") : std::nullopt;
  for (const auto& extensions : {inner, outer})
    for (const std::string_view name : spz_extension_names)
      if (const auto spz = extensions ? extensions->find(name) : std::nullopt) return spz;
  return std::nullopt;
}

Part parse_part(GltfDocument& document, const JsonField& primitive, const JsonField& extension,
                Contents& contents) {
  if (const auto mode = primitive.find("mode"); !mode || mode->count() != 0)
    primitive.fail("has Gaussians, but its 'mode' is not 0 (points)");
  check_words(extension, contents);
  contents.statements.read_members(extension.value());
  if (const auto extras = primitive.find("extras"))
    contents.statements.read_members(extras->value());
  if (const auto spz = spz_of(primitive))
    return parse_spz_part(document, *spz, extension, contents);
  Part part;
  const JsonField attributes = primitive.at("attributes");
  part.is_draft = is_draft(attributes);
  if (part.is_draft) {
    contents.note("it follows a draft of the extension: COLOR_0 is taken as what displays show");
    if (const auto scale = extension.find("quantizedPositionScale"); scale && scale->number() != 1)
      scale->fail("is not supported", "export positions as floats");
  } else {
    static_cast<void>(extension.at("kernel"));
    part.linear_colours = has_linear_colours(extension.at("colorSpace"), contents);
  }
  const auto name_of = [&](std::string_view name) {
    return part.is_draft ? fmt::format("_{}", name) : attribute_name(name);
  };
  const auto read = [&](std::string_view name, std::size_t columns, unsigned kinds) {
    const GltfAccessor accessor = attribute(document, attributes, name, columns, kinds);
    if (part.mean.count > 0 && accessor.count != part.mean.count)
      attributes.at(name).fail(
          fmt::format("has {} rows, and POSITION {}", accessor.count, part.mean.count));
    return accessor;
  };
  // Positions may have all types of KHR_mesh_quantization.
  part.mean = read("POSITION", 3, floats | signed_fractions | fractions | counts | signed_counts);
  part.rotation = read(name_of("ROTATION"), 4, floats | signed_fractions);
  part.scale = read(name_of("SCALE"), 3, floats | counts | fractions | signed_fractions);
  constexpr unsigned harmonics = floats | fractions | signed_fractions;
  if (part.is_draft) {
    part.opacity = read("COLOR_0", 4, floats | fractions);
    part.sh.emplace_back();
  } else {
    part.opacity = read(name_of("OPACITY"), 1, floats | fractions);
    part.sh.push_back(read(name_of(sh_name(0, 0)), 3, harmonics));
  }
  for (int degree = 1; degree <= max_sh_degree; ++degree) {
    if (!attributes.find(name_of(sh_name(degree, 0)))) continue;
    if (part.sh.size() != static_cast<std::size_t>(degree * degree))
      attributes.fail(fmt::format("has harmonics of degree {} and not of all below", degree));
    for (int k = 0; k <= 2 * degree; ++k)
      part.sh.push_back(read(name_of(sh_name(degree, k)), 3, harmonics));
  }
  part.count = part.mean.count;
  part.sh_degree = sh_degree_of_rest(part.sh.size() - 1);
  return part;
}

/// From the node's space to that of the node above.
AffineMap map_of(const JsonField& node) {
  if (const auto field = node.find("matrix")) return affine_map(*field);
  AffineMap map;
  if (const auto field = node.find("translation")) {
    const auto v = field->doubles<3>();
    map.offset = {v[0], v[1], v[2]};
  }
  if (const auto field = node.find("rotation")) {
    map.linear = glm::mat3_cast(field->orientation());
  }
  if (const auto field = node.find("scale")) {
    const auto s = field->doubles<3>();
    for (int k = 0; k < 3; ++k) map.linear[k] *= s[static_cast<std::size_t>(k)];
  }
  return map;
}

/// The Gaussians of a node's mesh.
void add_mesh(GltfDocument& document, const JsonField& node, const AffineMap& map,
              Contents& contents) {
  const auto index = node.find("mesh");
  if (!index) return;
  const JsonField primitives = document.at("meshes", *index).at("primitives");
  for (std::size_t i = 0; i < primitives.size(); ++i) {
    const JsonField primitive = primitives[i];
    if (++contents.primitives > max_primitives)
      primitive.fail(fmt::format("is one of more than {} at nodes", max_primitives));
    const auto extensions = primitive.find("extensions");
    auto extension = extensions ? extensions->find(extension_name) : std::nullopt;
    if (!extension) extension = spz_of(primitive);
    if (!extension) {
      contents.note("it has meshes beside its Gaussians, which are not shown");
      continue;
    }
    if (contents.parts.size() == max_parts)
      primitive.fail(fmt::format("is one of more than {} at nodes", max_parts));
    if (!map.usable()) node.fail("has a transform without an inverse");
    if (const auto own = node.find("extensions"); own && own->find("EXT_mesh_gpu_instancing"))
      contents.note("its instances (EXT_mesh_gpu_instancing) are not shown, only the mesh itself");
    Part part = parse_part(document, primitive, *extension, contents);
    part.map = map;
    contents.size.count += part.count;
    contents.size.sh_degree = std::max(contents.size.sh_degree, part.sh_degree);
    contents.parts.push_back(std::move(part));
  }
}

void check_extensions(const JsonField& root) {
  // Gaussians have no material.
  constexpr std::array<std::string_view, 3> known = {extension_name, "KHR_mesh_quantization",
                                                     "KHR_materials_unlit"};
  const auto required = root.find("extensionsRequired");
  if (!required) return;
  for (std::size_t i = 0; i < required->size(); ++i) {
    const std::string name = (*required)[i].text();
    if (std::ranges::count(known, name) + std::ranges::count(spz_extension_names, name) == 0)
      (*required)[i].fail(fmt::format("'{}' is not supported", name),
                          "export it without this extension");
  }
}

Contents contents_of(const ByteSource& file, GltfDocument& document, const AffineMap& world) {
  const JsonField root = document.root();
  check_extensions(root);
  struct Visit {
    JsonField index;
    AffineMap map;  // of the node above
  };
  std::vector<Visit> open;  // the next one last
  const auto add = [&](const JsonField& indices, const AffineMap& map) {
    for (std::size_t i = indices.size(); i > 0; --i) open.push_back({indices[i - 1], map});
  };
  const JsonField scenes = root.at("scenes");
  if (scenes.size() == 0) scenes.fail("is empty");
  const auto scene = root.find("scene");
  const auto roots = (scene ? document.at("scenes", *scene) : scenes[0]).find("nodes");
  if (roots) add(*roots, world);

  Contents contents;
  std::vector<bool> seen(root.at("nodes").size());
  while (!open.empty()) {
    const Visit visit = open.back();
    open.pop_back();
    const JsonField node = document.at("nodes", visit.index);
    if (seen[visit.index.count()]) node.fail("is held by two nodes, or by itself");
    seen[visit.index.count()] = true;
    const AffineMap map = visit.map * map_of(node);
    add_mesh(document, node, map, contents);
    if (const auto children = node.find("children")) add(*children, map);
  }
  if (contents.parts.empty())
    throw InputError(file.name(), "", "holds no Gaussians",
                     fmt::format("they are points with the extension {}", extension_name));
  const auto coefficients = static_cast<std::size_t>(sh_coefficient_count(contents.size.sh_degree));
  require_plausible_count(file, "scene", contents.size.count,
                          sizeof(float) * (3 + 4 + 3 + 1 + 3 * coefficients), document.bytes());
  contents.size.bytes = document.bytes();
  return contents;
}

/// IEC 61966-2-1.
double srgb_encoded(double linear) {
  return linear <= 0.0031308 ? 12.92 * linear : 1.055 * std::pow(linear, 1.0 / 2.4) - 0.055;
}

/// Replaces the coefficients of linear colours by those of the encoded ones.
void encode_colours(glm::vec3* sh, int degree) {
  const int coefficients = sh_coefficient_count(degree);
  std::array<glm::dvec3, 16> sums{};
  for_directions([&](const glm::dvec3& direction, double weight) {
    double basis[16];
    math::sh_basis<double>({direction.x, direction.y, direction.z}, degree, basis);
    glm::dvec3 colour(0.5);
    for (int k = 0; k < coefficients; ++k) colour += basis[k] * glm::dvec3(sh[k]);
    for (int c = 0; c < 3; ++c) colour[c] = srgb_encoded(std::max(colour[c], 0.0)) - 0.5;
    for (std::size_t k = 0; k < static_cast<std::size_t>(coefficients); ++k)
      sums[k] += weight * basis[k] * colour;
  });
  for (int k = 0; k < coefficients; ++k) sh[k] = glm::vec3(sums[static_cast<std::size_t>(k)]);
}

/// Takes a Gaussian from the numbers of its part to those of the cloud.
void finish(const Part& part, const CloudTransform& transform, std::size_t i,
            GaussianCloud& cloud) {
  const auto stride = static_cast<std::size_t>(cloud.sh_count());
  if (part.linear_colours) encode_colours(&cloud.sh[i * stride], part.sh_degree);
  transform.apply(cloud, i);
}

/// Stores the Gaussians of a part's .spz from Gaussian `first` of the cloud on.
void read_spz_part(const Part& part, std::size_t first, GaussianCloud& cloud,
                   const LoadContext& context) {
  const SliceSource file(*part.spz.file, part.spz.offset, part.spz.size);
  const SpzFile spz = read_spz(file, context.part(0.0, 0.8), SpzAxes::as_stored);
  if (spz.cloud.size() != part.count || spz.cloud.sh_degree != part.sh_degree)
    throw InputError(file.name(), "", "was changed while it was read");
  copy_gaussians(spz.cloud, first, cloud);
  if (spz.cloud.model != SplatModel::standard) cloud.model = spz.cloud.model;
  const CloudTransform transform(part.map);
  context.part(0.8, 1.0).for_blocks(part.count, 4096, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) finish(part, transform, first + i, cloud);
  });
}

/// Stores a part from Gaussian `first` of the cloud on.
void read_part(const Part& part, std::size_t first, GaussianCloud& cloud,
               const LoadContext& context) {
  if (part.spz.file) return read_spz_part(part, first, cloud, context);
  const CloudTransform transform(part.map);
  const std::size_t stride = static_cast<std::size_t>(cloud.sh_count());
  context.for_blocks(part.count, 4096, [&](std::size_t begin, std::size_t end) {
    const std::vector<float> mean = part.mean.read(begin, end),
                             rotation = part.rotation.read(begin, end),
                             scale = part.scale.read(begin, end),
                             opacity = part.opacity.read(begin, end);
    const auto vec3_at = [](const std::vector<float>& rows, std::size_t i) {
      return glm::vec3(rows[3 * i], rows[3 * i + 1], rows[3 * i + 2]);
    };
    for (std::size_t k = part.is_draft ? 1 : 0; k < part.sh.size(); ++k) {
      const std::vector<float> sh = part.sh[k].read(begin, end);
      for (std::size_t i = 0; i < end - begin; ++i)
        cloud.sh[(first + begin + i) * stride + k] = vec3_at(sh, i);
    }
    for (std::size_t i = 0; i < end - begin; ++i) {
      const std::size_t to = first + begin + i;
      const float* q = &rotation[4 * i];
      cloud.mean[to] = vec3_at(mean, i);
      cloud.rotation[to] = unit(glm::quat(q[3], q[0], q[1], q[2]));
      cloud.scale[to] = vec3_at(scale, i);
      const float alpha = part.is_draft ? opacity[4 * i + 3] : opacity[i];
      cloud.opacity[to] = alpha == 1.0f ? max_opacity : alpha;
      if (part.is_draft)
        for (int c = 0; c < 3; ++c)
          cloud.sh[to * stride][c] = sh_from_colour(opacity[4 * i + static_cast<std::size_t>(c)]);
      finish(part, transform, to, cloud);
    }
  });
}

}  // namespace

AffineMap affine_map(const JsonField& matrix) {
  constexpr double rounding = 1e-9, float_rounding = 1e-6;
  const auto m = matrix.doubles<16>();  // by columns
  const double last = std::max({std::abs(m[3]), std::abs(m[7]), std::abs(m[11])});
  if (last > rounding || std::abs(m[15] - 1.0) > float_rounding)
    matrix.fail("has a last row other than 0, 0, 0, 1");
  return {{m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]}, {m[12], m[13], m[14]}};
}

GltfSize read_gltf_size(const ByteSource& file, const FileSet& beside) {
  GltfDocument document(file, beside);
  Contents contents = contents_of(file, document, left_up_front);
  contents.size.notes = std::move(contents.statements.notes);
  return contents.size;
}

std::vector<std::string> gltf_buffer_files(const ByteSource& file) {
  return GltfDocument(file, FolderFiles({})).buffer_files();
}

GltfFile read_gltf(const ByteSource& file, const FileSet& beside, const LoadContext& context,
                   const AffineMap& world) {
  GltfDocument document(file, beside);
  const Contents contents = contents_of(file, document, world);
  GltfFile result{{}, contents.statements.notes};
  result.cloud.model = contents.statements.model.value_or(SplatModel::standard);
  result.cloud.resize(contents.size.count, contents.size.sh_degree);
  const auto total = static_cast<double>(contents.size.count);
  std::size_t first = 0;
  for (const Part& part : contents.parts) {
    const std::size_t end = first + part.count;
    read_part(part, first, result.cloud,
              context.part(static_cast<double>(first) / total, static_cast<double>(end) / total));
    first = end;
  }
  return result;
}

constexpr SceneFormat gltf_format = {
    .name = "glTF",
    .extensions = {".glb", ".gltf"},
    .may_be_mesh = true,
    .keeps_origin = true,
    .is_mine = [](const ByteSource& file,
                  std::string_view extension) { return is_glb(file) || extension == ".gltf"; },
    .files_beside = gltf_buffer_files,
    .size = [](const SceneFiles& files) -> SceneSize {
      const GltfSize size =
          read_gltf_size(FileSource(files.path), FolderFiles(files.path.parent_path()));
      return {size.count, size.sh_degree};
    },
    .read = [](const SceneFiles& files, const LoadContext& context) -> DecodedScene {
      const FileSource file(files.path);
      return read_about_origin([&](const glm::dvec3& origin) -> DecodedScene {
        GltfFile gltf = read_gltf(file, FolderFiles(files.path.parent_path()), context,
                                  {left_up_front.linear, -origin});
        return {"glTF", std::move(gltf.cloud), std::move(gltf.notes)};
      });
    },
    .write = [](const GaussianCloud& cloud, const glm::dvec3& origin, ThreadPool&,
                std::ostream& to) { write_glb(cloud, to, origin); },
};

}  // namespace catgs

#include "render_core/scene/files/load_scene.h"

#include <array>
#include <memory>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "render_core/base/error.h"
#include "render_core/scene/files/locate_scene.h"
#include "render_core/scene/files/open_levels.h"
#include "render_core/scene/files/sanitize.h"
#include "render_core/scene/formats/byte_source.h"
#include "render_core/scene/formats/compressed_ply.h"
#include "render_core/scene/formats/file_set.h"
#include "render_core/scene/formats/format_limits.h"
#include "render_core/scene/formats/gltf.h"
#include "render_core/scene/formats/gltf_document.h"
#include "render_core/scene/formats/json_field.h"
#include "render_core/scene/formats/ksplat.h"
#include "render_core/scene/formats/load_context.h"
#include "render_core/scene/formats/ply.h"
#include "render_core/scene/formats/sog.h"
#include "render_core/scene/formats/splat.h"
#include "render_core/scene/formats/spz.h"
#include "render_core/scene/formats/streamed_sog.h"
#include "render_core/scene/scene.h"
#include "render_core/scene/transform.h"
#include "render_core/scene/tree/read_tree.h"

namespace catgs {

namespace {

struct Decoded {
  std::string format;
  GaussianCloud cloud;
  std::vector<std::string> notes{};
  std::optional<OrbitLimits> orbit{};
};

Decoded read_any_ply(const ByteSource& file, const LoadContext& context) {
  const PlyHeader header = read_ply_header(file);
  if (is_compressed_ply(header))
    return {"compressed ply", read_compressed_ply(file, header, context)};
  GaussianCloud cloud = read_ply(file, header, context);
  const std::size_t rest = header.find("vertex")->rest_count();
  return {"3DGS ply", std::move(cloud), notes_of_degree(sh_degree_of_rest(rest / 3))};
}

/// The first bytes of a file tell its format. Only .gltf, .ksplat and .splat have no such mark
/// and are told by their names.
Decoded read_file(const std::filesystem::path& path, const LoadContext& context) {
  const FileSource file(path);
  std::array<char, 4> magic{};
  const auto start = std::span(magic).first(std::min<std::uint64_t>(4, file.size()));
  file.read(0, std::as_writable_bytes(start));
  const std::string_view begins(start.data(), start.size());
  if (begins.starts_with("ply")) return read_any_ply(file, context);
  if (begins == "PK\x03\x04") {
    SogFile sog = read_sog(ZipFiles(file), "meta.json", context);
    return {fmt::format("sog v{} (zip)", sog.version), std::move(sog.cloud)};
  }
  if (is_tree(file)) {
    TreeScene tree = read_tree(std::make_unique<FileSource>(path), context);
    return {"tree", std::move(tree.cloud), std::move(tree.notes)};
  }
  if (is_spz(file)) {
    SpzFile spz = read_spz(file, context);
    return {fmt::format("spz v{}", spz.version), std::move(spz.cloud),
            notes_of_degree(spz.sh_degree), spz.orbit};
  }
  if (is_glb(file) || path.extension() == ".gltf") {
    GltfFile gltf = read_gltf(file, FolderFiles(path.parent_path()), context);
    return {"glTF", std::move(gltf.cloud), std::move(gltf.notes)};
  }
  if (path.extension() == ".ksplat") return {"ksplat", read_ksplat(file, context)};
  if (path.extension() == ".splat") return {"splat", read_splat(file, context)};
  throw InputError(path.string(), "", "is no scene of a known format", supported_scenes);
}

Decoded read_location(const SceneLocation& location, const LoadOptions& options,
                      const LoadContext& context) {
  if (location.kind == SceneLocation::Kind::file) return read_file(location.path, context);
  if (location.kind == SceneLocation::Kind::sog_folder) {
    SogFile sog = read_sog(FolderFiles(location.path), "meta.json", context);
    return {fmt::format("sog v{} (folder)", sog.version), std::move(sog.cloud)};
  }
  const auto files = files_of_levels(location);
  if (location.is_streamed_sog()) {
    StreamedSog sog = read_streamed_sog(*files, options.lod, options.gaussian_budget, context);
    return {fmt::format("streamed sog ({})", sog.detail), std::move(sog.cloud)};
  }
  const OpenLevels scene = open_levels(location, files, options);
  return {scene.format, read_levels(scene, context), scene.notes};
}

}  // namespace

Scene load_scene(const std::filesystem::path& path, const LoadOptions& options) {
  const auto pool = std::make_shared<ThreadPool>(options.threads);
  const LoadContext context(*pool, options.progress);
  SceneLocation location = locate_scene(path);
  if (!location.has_levels() && (options.lod || options.gaussian_budget))
    throw InputError(path.string(), "", "has no levels of detail to choose from",
                     "levels and budgets are for streamed SOG, 3D Tiles and LCC2");

  Scene scene;
  scene.name = to_utf8(location.name);
  Decoded decoded = read_location(location, options, context.part(0.0, 0.9));
  scene.format = std::move(decoded.format);
  scene.cloud = std::move(decoded.cloud);
  scene.notes = std::move(decoded.notes);
  location.hints.orbit = decoded.orbit;
  // Surfels of a tree are flat already, and their axes are in another order.
  const bool is_flat = scene.format == "tree" && scene.cloud.model == SplatModel::surfels;
  use_model(location.hints, options.model, scene.cloud.model, scene.notes);
  if (scene.cloud.model == SplatModel::surfels && !is_flat) flatten(scene.cloud);
  scene.report = sanitize(scene.cloud, context.part(0.9, 1.0));
  if (scene.cloud.empty())
    throw InputError(path.string(), "",
                     fmt::format("none of its {} Gaussians can be drawn", scene.report.read));
  if (options.first_view || tell_anything(location.hints))
    scene.hints = find_hints(scene.cloud, location.hints, options.up, scene.notes, pool);
  context.report(1.0);
  return scene;
}

SceneInPages open_in_pages(const std::filesystem::path& path, const LoadOptions& options,
                           const std::filesystem::path& made_of) {
  constexpr std::uint64_t outline_gaussians = 1'000'000;
  const SceneLocation location = locate_scene(path);
  if (location.kind != SceneLocation::Kind::file || !is_tree(FileSource(location.path)))
    throw InputError(path.string(), "", "is no tree, so it has no detail to choose",
                     "make one with catgs-render convert IN OUT.tree");
  const SceneLocation named = made_of.empty() ? location : locate_scene(made_of);
  const auto pool = std::make_shared<ThreadPool>(options.threads);
  const LoadContext context(*pool, options.progress);
  SceneInPages scene;
  scene.tree = std::make_shared<TreeFile>(std::make_unique<FileSource>(location.path));
  SplatModel model = scene.tree->model();
  use_model(named.hints, options.model, model, scene.outline.notes);
  if (model == SplatModel::surfels && scene.tree->model() != model)
    throw InputError(path.string(), "model", "cannot be made 2dgs in pages",
                     "convert the scene with --model 2dgs");
  scene.tree->set_model(model);
  TreeScene outline = read_tree(*scene.tree, outline_gaussians, context.part(0.0, 0.9));
  scene.outline.name = to_utf8(named.name);
  scene.outline.format = "tree";
  scene.outline.cloud = std::move(outline.cloud);
  scene.outline.notes.insert(scene.outline.notes.end(), outline.notes.begin(), outline.notes.end());
  const TreeHeader& header = scene.tree->header();
  scene.outline.report = {.read = header.read, .dropped = header.dropped};
  scene.outline.hints =
      find_hints(scene.outline.cloud, named.hints, options.up, scene.outline.notes, pool);
  context.report(1.0);
  return scene;
}

}  // namespace catgs

#include "render_core/scene/files/scene_size.h"

#include <algorithm>
#include <array>
#include <string_view>

#include "render_core/base/error.h"
#include "render_core/scene/files/locate_scene.h"
#include "render_core/scene/files/open_levels.h"
#include "render_core/scene/formats/byte_source.h"
#include "render_core/scene/formats/compressed_ply.h"
#include "render_core/scene/formats/file_set.h"
#include "render_core/scene/formats/format_limits.h"
#include "render_core/scene/formats/gltf.h"
#include "render_core/scene/formats/gltf_document.h"
#include "render_core/scene/formats/ksplat.h"
#include "render_core/scene/formats/ply_header.h"
#include "render_core/scene/formats/sog.h"
#include "render_core/scene/formats/spz.h"
#include "render_core/scene/formats/streamed_sog.h"
#include "render_core/scene/tree/tree_file.h"

namespace catgs {

namespace {

SceneSize size_of_ply(const ByteSource& file) {
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

SceneSize size_of_sog(const FileSet& files) {
  const SogMeta meta = parse_sog_meta(files, "meta.json");
  return {meta.count, meta.hides_sh_degree() ? max_sh_degree : meta.sh_degree};
}

SceneSize size_of_levels(const OpenLevels& scene) { return {scene.count, scene.sh_degree}; }

/// An archive is unpacked as a whole only where its environment counts, too.
std::size_t count_in_archive(const ByteSource& file, const LoadOptions& options) {
  const ZipFiles meta(file, "lod-meta.json");
  if (read_lod_tree(*meta.open("lod-meta.json")).environment.empty())
    return count_streamed_sog(meta, options.lod, options.gaussian_budget);
  return count_streamed_sog(ZipFiles(file), options.lod, options.gaussian_budget);
}

SceneSize size_of_file(const std::filesystem::path& path) {
  constexpr std::uint64_t splat_bytes = 32;
  const FileSource file(path);
  std::array<char, 4> magic{};
  const auto start = std::span(magic).first(std::min<std::uint64_t>(4, file.size()));
  file.read(0, std::as_writable_bytes(start));
  const std::string_view begins(start.data(), start.size());
  if (begins.starts_with("ply")) return size_of_ply(file);
  if (begins == "PK\x03\x04") return size_of_sog(ZipFiles(file, "meta.json"));
  if (is_tree(file)) {
    const TreeHeader header = read_tree_header(file);
    return {header.gaussians, static_cast<int>(header.sh_degree), true};
  }
  if (is_spz(file)) {
    const SpzSize size = read_spz_size(file);
    return {size.count, size.sh_degree};
  }
  if (is_glb(file) || path.extension() == ".gltf") {
    const GltfSize size = read_gltf_size(file, FolderFiles(path.parent_path()));
    return {size.count, size.sh_degree};
  }
  if (path.extension() == ".ksplat") {
    const KsplatSize size = read_ksplat_size(file);
    return {size.count, size.sh_degree};
  }
  if (path.extension() == ".splat") return {file.size() / splat_bytes, 0};
  throw InputError(path.string(), "", "is no scene of a known format", supported_scenes);
}

}  // namespace

std::uint64_t SceneSize::bytes() const { return GaussianCloud::bytes(gaussians, sh_degree); }

SceneSize read_scene_size(const std::filesystem::path& path, const LoadOptions& options) {
  const SceneLocation location = locate_scene(path);
  SceneSize size;
  if (location.kind == SceneLocation::Kind::file)
    size = size_of_file(location.path);
  else if (location.kind == SceneLocation::Kind::sog_folder)
    size = size_of_sog(FolderFiles(location.path));
  else if (location.kind == SceneLocation::Kind::streamed_sog_archive)
    size = {count_in_archive(FileSource(location.path), options), max_sh_degree};
  else if (location.kind == SceneLocation::Kind::streamed_sog_folder)
    size = {count_streamed_sog(FolderFiles(location.path), options.lod, options.gaussian_budget),
            max_sh_degree};
  else
    size = size_of_levels(open_levels(location, files_of_levels(location), options));
  size.sh_degree = std::min(size.sh_degree, max_sh_degree);
  return size;
}

}  // namespace catgs

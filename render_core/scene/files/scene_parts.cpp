#include "render_core/scene/files/scene_parts.h"

#include <algorithm>
#include <array>
#include <functional>
#include <span>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include "render_core/scene/files/locate_scene.h"
#include "render_core/scene/files/open_levels.h"
#include "render_core/scene/files/sanitize.h"
#include "render_core/scene/formats/byte_source.h"
#include "render_core/scene/formats/compressed_ply.h"
#include "render_core/scene/formats/format_limits.h"
#include "render_core/scene/formats/gltf_document.h"
#include "render_core/scene/formats/load_context.h"
#include "render_core/scene/formats/ply.h"
#include "render_core/scene/formats/splat.h"
#include "render_core/scene/formats/spz.h"
#include "render_core/scene/keep_if.h"
#include "render_core/scene/transform.h"
#include "render_core/scene/tree/tree_file.h"

namespace catgs {
namespace {

constexpr std::uint64_t sample_size = std::uint64_t{1} << 16;  // robust_bounds() looks at as many

/// A scene that is read part by part, not sanitized.
struct Parts {
  std::string format;  // as Scene::format
  std::uint64_t count = 0;
  std::function<GaussianCloud(std::uint64_t part, const LoadContext&)> read;
  GaussianCloud sample;            // even
  std::vector<std::string> notes;  // as Scene::notes
};

/// A file of which any rows can be read.
template <class ReadRows>
Parts parts_of_rows(std::string format, std::uint64_t rows, std::uint64_t part_rows,
                    const ReadRows& read, const LoadContext& context,
                    std::vector<std::string> notes = {}) {
  const std::uint64_t step = (rows + sample_size - 1) / sample_size;
  const auto read_part = [=](std::uint64_t part, const LoadContext& reading) {
    const std::uint64_t first = part * part_rows;
    return read(FileRows{first, std::min(part_rows, rows - first)}, reading);
  };
  return {std::move(format), (rows + part_rows - 1) / part_rows, read_part,
          read(FileRows{0, (rows + step - 1) / step, step}, context), std::move(notes)};
}

std::optional<Parts> ply_in_parts(const std::shared_ptr<const ByteSource>& file,
                                  std::uint64_t part_rows, const LoadContext& context) {
  const auto header = std::make_shared<const PlyHeader>(read_ply_header(*file));
  const PlyElement* vertex = header->find("vertex");
  if (!vertex || header->encoding == PlyEncoding::ascii || is_compressed_ply(*header))
    return std::nullopt;
  require_rows_in_file(*file, *vertex, TreeShape::max_gaussians);
  const auto read = [=](const FileRows& rows, const LoadContext& reading) {
    return read_ply_rows(*file, *header, rows, reading);
  };
  return parts_of_rows("3DGS ply", vertex->count, part_rows, read, context,
                       notes_of_degree(sh_degree_of_rest(vertex->rest_count() / 3)));
}

Parts splat_in_parts(const std::shared_ptr<const ByteSource>& file, std::uint64_t part_rows,
                     const LoadContext& context) {
  const auto read = [=](const FileRows& rows, const LoadContext& reading) {
    return read_splat_rows(*file, rows, reading);
  };
  return parts_of_rows("splat", count_splat(*file, TreeShape::max_gaussians), part_rows, read,
                       context);
}

/// The formats are told apart as load_scene() does.
std::optional<Parts> file_in_parts(const std::filesystem::path& path, std::uint64_t part_rows,
                                   const LoadContext& context) {
  const auto file = std::make_shared<const FileSource>(path);
  std::array<char, 4> magic{};
  const auto start = std::span(magic).first(std::min<std::uint64_t>(4, file->size()));
  file->read(0, std::as_writable_bytes(start));
  const std::string_view begins(start.data(), start.size());
  if (begins.starts_with("ply")) return ply_in_parts(file, part_rows, context);
  if (path.extension() != ".splat" || begins == "PK\x03\x04" || is_tree(*file) || is_spz(*file) ||
      is_glb(*file))
    return std::nullopt;
  return splat_in_parts(file, part_rows, context);
}

/// The sample is the coarsest level, which costs little to read. So a single level is no scene in
/// parts.
std::optional<Parts> levels_in_parts(const SceneLocation& location, const LoadContext& context) {
  const auto files = files_of_levels(location);
  const OpenLevels scene = open_levels(location, files, {}, TreeShape::max_gaussians);
  if (scene.levels == 1) return std::nullopt;
  LoadOptions coarsest;
  coarsest.lod = scene.levels - 1;
  Parts parts{scene.format, scene.parts, scene.read,
              read_levels(open_levels(location, files, coarsest), context), scene.notes};
  const std::size_t step = (parts.sample.size() + sample_size - 1) / sample_size;
  keep_if(parts.sample, [&](std::size_t i) { return i % step == 0; });
  return parts;
}

std::optional<Parts> open_parts(const SceneLocation& location, std::uint64_t part_rows,
                                const LoadContext& context) {
  if (location.has_levels()) return levels_in_parts(location, context);
  if (location.kind != SceneLocation::Kind::file) return std::nullopt;
  return file_in_parts(location.path, part_rows, context);
}

}  // namespace

std::optional<PartedScene> scene_in_parts(const std::filesystem::path& path,
                                          const LoadOptions& options,
                                          const std::shared_ptr<ThreadPool>& pool,
                                          std::uint64_t part_rows, bool wants_hints) {
  const SceneLocation location = locate_scene(path);
  const LoadContext context(*pool);
  std::optional<Parts> parts = open_parts(location, part_rows, context);
  if (!parts) return std::nullopt;
  PartedScene scene;
  scene.notes = std::move(parts->notes);
  GaussianCloud& sample = parts->sample;
  use_model(location.hints, options.model, sample.model, scene.notes);
  if (sample.model == SplatModel::surfels) flatten(sample);
  const SaneReach reach = sane_reach(sample);
  sanitize(sample, reach, context);

  if (wants_hints && !sample.empty())
    scene.hints = find_hints(sample, location.hints, options.up, scene.notes, pool);
  scene.parts.format = parts->format;
  scene.parts.each = [read = parts->read, count = parts->count, used = sample.model, reach,
                      pool](const auto& take) {
    const LoadContext reading(*pool);
    std::uint64_t dropped = 0;
    for (std::uint64_t i = 0; i < count; ++i) {
      GaussianCloud part = read(i, reading);
      part.model = used;
      if (used == SplatModel::surfels) flatten(part);
      dropped += sanitize(part, reach, reading).dropped;
      take(part);
    }
    return dropped;
  };
  scene.sample = std::move(sample);
  return scene;
}

}  // namespace catgs

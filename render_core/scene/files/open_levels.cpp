#include "render_core/scene/files/open_levels.h"

#include <cassert>

#include <fmt/format.h>

#include "render_core/scene/formats/lcc2.h"
#include "render_core/scene/formats/streamed_sog.h"
#include "render_core/scene/formats/tiles.h"

namespace catgs {

namespace {

OpenLevels open_streamed(const std::shared_ptr<const FileSet>& files, const LoadOptions& options,
                         std::uint64_t most) {
  const auto sog = std::make_shared<const OpenStreamedSog>(
      open_streamed_sog(*files, options.lod, options.gaussian_budget, most));
  OpenLevels scene;
  scene.format = fmt::format("streamed sog ({})", sog->detail);
  scene.levels = sog->levels;
  scene.sh_degree = sog->sh_degree;
  scene.count = sog->count;
  scene.parts = sog->parts.size();
  scene.read = [files, sog](std::size_t part, const LoadContext& context) {
    return read_streamed_sog_part(*files, *sog, part, context);
  };
  return scene;
}

}  // namespace

std::shared_ptr<const FileSet> files_of_levels(const SceneLocation& location) {
  if (location.kind == SceneLocation::Kind::streamed_sog_archive)
    return std::make_shared<const ZipFiles>(FileSource(location.path));
  return std::make_shared<const FolderFiles>(location.path);
}

OpenLevels open_levels(const SceneLocation& location, const std::shared_ptr<const FileSet>& files,
                       const LoadOptions& options, std::uint64_t most) {
  assert(location.has_levels());
  if (location.kind == SceneLocation::Kind::tiles_folder)
    return open_tiles(files, "tileset.json", options.lod, options.gaussian_budget, most);
  if (location.kind == SceneLocation::Kind::lcc2)
    return open_lcc2(files, location.index, options.lod, options.gaussian_budget, most);
  return open_streamed(files, options, most);
}

}  // namespace catgs

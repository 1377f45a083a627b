#include "render_core/scene/files/scene_size.h"

#include <algorithm>

#include "render_core/scene/formats/format_limits.h"

namespace catgs {

SceneSize read_scene_size(const SceneLocation& scene, const LoadOptions& options) {
  const SceneFormat& format = *scene.format;
  SceneSize size;
  if (!scene.has_levels()) {
    size = format.size(scene.files);
  } else if (format.count) {
    size = {format.count(scene.files, options.lod, options.gaussian_budget), max_sh_degree};
  } else {
    const OpenLevels levels = format.open_levels(scene.files.open(), scene.files.index, options.lod,
                                                 options.gaussian_budget, max_gaussians);
    size = {levels.count, levels.sh_degree};
  }
  size.sh_degree = std::min(size.sh_degree, max_sh_degree);
  return size;
}

}  // namespace catgs

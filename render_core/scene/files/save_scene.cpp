#include "render_core/scene/files/save_scene.h"

#include <cassert>
#include <string>

#include "render_core/base/error.h"
#include "render_core/base/part_file.h"
#include "render_core/scene/files/scene_formats.h"

namespace catgs {

namespace {

/// The format that is written to a file of this name. Throws InputError.
const SceneFormat& format_to_write(const std::filesystem::path& path) {
  const std::string remedy = "use " + written_extensions();
  if (path.string().ends_with(".compressed.ply"))
    throw InputError(path.string(), "", "compressed PLY is only read, not written", remedy);
  const std::string extension = path.extension().string();
  const SceneFormat* format = format_with(extension);
  if (format != nullptr && format->write && format->extensions[0] == extension) return *format;
  throw InputError(path.string(), "", "cannot be written: unknown extension '" + extension + "'",
                   remedy);
}

}  // namespace

void check_can_be_saved(const std::filesystem::path& path) { format_to_write(path); }

bool keeps_model(const std::filesystem::path& path, SplatModel model) {
  if (model == SplatModel::standard) return true;
  const SceneFormat* format = format_with(path.extension().string());
  if (format == nullptr) return false;
  return model == SplatModel::antialiased ? format->keeps_antialiased : format->keeps_surfels;
}

std::vector<std::string> losses_of(const GaussianCloud& cloud, const std::filesystem::path& path) {
  const SceneFormat* format = format_with(path.extension().string());
  if (format == nullptr || !format->losses) return {};
  try {
    return format->losses(cloud);
  } catch (const InputError& e) {
    throw InputError(path.string(), "", e.what());
  }
}

bool keeps_origin(const std::filesystem::path& path) {
  const SceneFormat* format = format_with(path.extension().string());
  return format != nullptr && format->keeps_origin;
}

void save_scene(const GaussianCloud& cloud, const std::filesystem::path& path, int threads,
                const glm::dvec3& origin) {
  assert(cloud.sizes_agree());
  const SceneFormat& format = format_to_write(path);
  ThreadPool pool(threads);
  PartFile file(path);
  try {
    format.write(cloud, origin, pool, file.stream());
  } catch (const InputError& e) {  // the writers do not know the file's name
    throw InputError(path.string(), "", e.what());
  }
  file.finish();
}

}  // namespace catgs

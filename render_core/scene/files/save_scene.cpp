#include "render_core/scene/files/save_scene.h"

#include <cassert>
#include <ostream>
#include <string>

#include "render_core/base/error.h"
#include "render_core/base/part_file.h"
#include "render_core/scene/formats/ply.h"
#include "render_core/scene/formats/splat.h"
#include "render_core/scene/formats/spz.h"

namespace catgs {

void save_scene(const GaussianCloud& cloud, const std::filesystem::path& path) {
  assert(cloud.sizes_agree());
  const std::string extension = path.extension().string();
  void (*write)(const GaussianCloud&, std::ostream&) = nullptr;
  if (extension == ".ply") write = write_ply;
  if (extension == ".splat") write = write_splat;
  if (extension == ".spz") write = write_spz;
  if (!write)
    throw InputError(path.string(), "", "cannot be written: unknown extension '" + extension + "'",
                     "use .ply, .splat or .spz");

  PartFile file(path);
  try {
    write(cloud, file.stream());
  } catch (const InputError& e) {  // the writers do not know the file's name
    throw InputError(path.string(), "", e.what());
  }
  file.finish();
}

}  // namespace catgs

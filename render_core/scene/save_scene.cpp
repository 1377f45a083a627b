#include "render_core/scene/save_scene.h"

#include <fstream>
#include <system_error>

#include "render_core/error.h"
#include "render_core/scene/ply.h"
#include "render_core/scene/splat.h"
#include "render_core/scene/spz.h"

namespace catgs {

void save_scene(const GaussianCloud& cloud, const std::filesystem::path& path) {
  const std::string extension = path.extension().string();
  void (*write)(const GaussianCloud&, std::ostream&) = nullptr;
  if (extension == ".ply") write = write_ply;
  if (extension == ".splat") write = write_splat;
  if (extension == ".spz") write = write_spz;
  if (!write)
    throw InputError(path.string(), "", "cannot be written: unknown extension '" + extension + "'",
                     "use .ply, .splat or .spz");

  std::filesystem::path part = path;
  part += ".part";
  std::error_code error, ignored;
  std::ofstream file(part, std::ios::binary | std::ios::trunc);
  if (file) {
    try {
      write(cloud, file);
    } catch (const InputError& e) {  // the writers do not know the file's name
      std::filesystem::remove(part, ignored);
      throw InputError(path.string(), "", e.what());
    }
    file.close();
  }
  const bool written = file.good();
  if (written) std::filesystem::rename(part, path, error);
  if (!written || error) {
    std::filesystem::remove(part, ignored);
    throw InputError(path.string(), "", error ? error.message() : "cannot be written",
                     "does the folder exist, and is there space?");
  }
}

}  // namespace catgs

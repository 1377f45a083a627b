#include "render_core/scene/save_scene.h"

#include <fstream>
#include <system_error>

#include "render_core/error.h"
#include "render_core/scene/ply.h"

namespace catgs {

void save_scene(const GaussianCloud& cloud, const std::filesystem::path& path) {
  const std::string extension = path.extension().string();
  void (*write)(const GaussianCloud&, std::ostream&) = nullptr;
  if (extension == ".ply") write = write_ply;
  if (!write)
    throw InputError(path.string(), "", "cannot be written: unknown extension '" + extension + "'",
                     "use .ply");

  std::filesystem::path part = path;
  part += ".part";
  std::error_code error;
  std::ofstream file(part, std::ios::binary | std::ios::trunc);
  if (file) {
    write(cloud, file);
    file.close();
  }
  const bool written = file.good();
  if (written) std::filesystem::rename(part, path, error);
  if (!written || error) {
    std::error_code ignored;
    std::filesystem::remove(part, ignored);
    throw InputError(path.string(), "", error ? error.message() : "cannot be written",
                     "does the folder exist, and is there space?");
  }
}

}  // namespace catgs

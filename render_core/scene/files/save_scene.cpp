#include "render_core/scene/files/save_scene.h"

#include <cassert>
#include <functional>
#include <ostream>
#include <string>
#include <string_view>

#include "render_core/base/error.h"
#include "render_core/base/part_file.h"
#include "render_core/scene/formats/gltf.h"
#include "render_core/scene/formats/ply.h"
#include "render_core/scene/formats/sog.h"
#include "render_core/scene/formats/splat.h"
#include "render_core/scene/formats/spz.h"

namespace catgs {

namespace {

constexpr std::string_view remedy = "use .ply, .splat, .spz, .sog, .glb or .tree";

using Writer = std::function<void(const GaussianCloud&, std::ostream&)>;

Writer writer_for(const std::filesystem::path& path, int threads = 0) {
  if (path.string().ends_with(".compressed.ply"))
    throw InputError(path.string(), "", "compressed PLY is only read, not written", remedy);
  const std::string extension = path.extension().string();
  if (extension == ".ply") return write_ply;
  if (extension == ".splat") return write_splat;
  if (extension == ".spz") return write_spz;
  if (extension == ".glb") return write_glb;
  if (extension == ".sog")
    return [threads](const GaussianCloud& cloud, std::ostream& to) {
      ThreadPool pool(threads);
      write_sog(cloud, pool, to);
    };
  throw InputError(path.string(), "", "cannot be written: unknown extension '" + extension + "'",
                   remedy);
}

}  // namespace

void check_can_be_saved(const std::filesystem::path& path) { writer_for(path); }

bool keeps_model(const std::filesystem::path& path, SplatModel model) {
  const std::string extension = path.extension().string();
  if (model == SplatModel::standard) return true;
  if (extension == ".spz") return model == SplatModel::antialiased;
  return extension == ".ply" || extension == ".sog" || extension == ".tree";
}

void save_scene(const GaussianCloud& cloud, const std::filesystem::path& path, int threads) {
  assert(cloud.sizes_agree());
  const Writer write = writer_for(path, threads);
  PartFile file(path);
  try {
    write(cloud, file.stream());
  } catch (const InputError& e) {  // the writers do not know the file's name
    throw InputError(path.string(), "", e.what());
  }
  file.finish();
}

}  // namespace catgs

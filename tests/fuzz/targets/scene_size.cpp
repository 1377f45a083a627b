#include "render_core/scene/files/scene_size.h"

#include <sstream>

#include "render_core/scene/formats/compressed_ply.h"
#include "render_core/scene/formats/file_set.h"
#include "render_core/scene/formats/ply.h"
#include "render_core/scene/formats/sog.h"
#include "render_core/scene/formats/spz.h"
#include "tests/fuzz/target.h"
#include "tests/render_core/scene/formats/encoders.h"
#include "tests/render_core/scene/random_cloud.h"

namespace catgs::fuzz {
namespace {

GaussianCloud read(Bytes input) {
  const MemorySource file("input", input);
  if (is_spz(file)) return read_spz(file, one_thread()).cloud;
  if (text_of(input).starts_with("PK"))
    return read_sog(ZipFiles(file), "meta.json", one_thread()).cloud;
  const PlyHeader header = read_ply_header(file);
  return is_compressed_ply(header) ? read_compressed_ply(file, header, one_thread())
                                   : read_ply(file, header, one_thread());
}

/// What a scene's header says of its size, by which there is room for it or not.
void parse_scene_size(Bytes input) {
  static FileInMemory file;
  file.rewrite(input);
  const SceneSize size = read_scene_size(locate_scene(file.path()), {});
  require(size.gaussians > 0 && size.gaussians <= 1 << 28, "scenes have Gaussians, and an end");
  require(size.sh_degree >= 0 && size.sh_degree <= 3, "degrees are those that there are");
  GaussianCloud cloud;
  try {
    cloud = read(input);
  } catch (const InputError&) {
    return;  // the header alone was fine
  }
  require(cloud.size() <= size.gaussians && cloud.sh_degree <= size.sh_degree,
          "scenes take no more room than they said");
}

std::map<std::string, std::string> scene_size_seeds() {
  std::ostringstream ply;
  write_ply(test::random_cloud(2, 1), ply);
  return {{"ply", ply.str()},
          {"compressed_ply", test::encode_compressed_ply(test::random_cloud(2, 1), false)},
          {"spz_2", test::encode_spz(test::random_cloud(2, 1), {.version = 2})},
          {"spz_4", test::encode_spz(test::random_cloud(2, 1), {.version = 4})},
          {"sog_1", test::zip(test::encode_sog(test::random_cloud(2, 1), 1))},
          {"sog_2", test::zip(test::encode_sog(test::random_cloud(2, 0), 2))}};
}

}  // namespace

std::vector<Target> scene_size_targets() {
  return {{.name = "scene_size",
           .parse = parse_scene_size,
           .seeds = scene_size_seeds,
           .dictionary = {"ply\n", "element vertex ", "property float f_rest_0\n", "NGSP", "PK\3\4",
                          "\x1f\x8b", "\"count\":", "\"bands\":", "268435457"},
           .max_bytes = 16384}};
}

}  // namespace catgs::fuzz

#include "server/scenes/kept_posters.h"

#include <utility>

#include <fmt/format.h>

#include "render_core/base/error.h"
#include "server/scenes/kept_views.h"
#include "server/scenes/tours.h"

namespace catgs {
namespace {

constexpr std::size_t most_poster_bytes = 1 << 20;  // in --cache-dir

/// Throws InputError.
std::string poster_name(const FoundScene& found, const SceneRepresentation& representation,
                        const ServerConfig& config) {
  constexpr int version = 2;  // of how posters are drawn
  const SceneLocation& scene = found.location;
  const std::string facts = fmt::format(
      "{}\n{} {} {}\n{}", found.tree.empty() ? tree_name(scene, chosen_levels(config)) : found.tree,
      version, config.up, representation.most_gaussians,
      sidecar_text(scene.hints.sidecar).value_or(""));
  return derived_name(scene, facts + camera_facts(scene.hints), ".jpg");
}

void check_jpeg(const ByteSource& file) {
  const std::vector<std::byte> bytes = file.read_all(most_poster_bytes);
  const std::size_t size = bytes.size();
  constexpr std::byte marker{0xff}, start{0xd8}, end{0xd9};
  if (size < 4 || bytes[0] != marker || bytes[1] != start || bytes[size - 2] != marker ||
      bytes[size - 1] != end)
    throw InputError(file.name(), {}, "is no whole JPEG file");
}

Poster read_poster(const DerivedFiles& files, const std::string& name) {
  auto kept = files.read(name, most_poster_bytes, check_jpeg);
  return kept ? std::make_shared<const std::string>(*std::move(kept)) : nullptr;
}

}  // namespace

Poster kept_poster(const DerivedFiles* files, const FoundScene& found,
                   const SceneRepresentation& representation, const ServerConfig& config) {
  if (!files || found.location.format == nullptr) return nullptr;
  return read_poster(*files, poster_name(found, representation, config));
}

KeepPoster keep_poster(const DerivedFiles* files, const FoundScene& found,
                       const SceneRepresentation& representation, const ServerConfig& config) {
  if (!files || found.location.format == nullptr) return {};
  return [files,
          name = poster_name(found, representation, config)](const std::function<Poster()>& make) {
    if (Poster kept = read_poster(*files, name)) return kept;
    Poster made = make();
    if (made) files->write(name, *made, DerivedFiles::most_posters);
    return made;
  };
}

}  // namespace catgs

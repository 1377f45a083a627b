#include <array>
#include <span>
#include <string_view>
#include <utility>

#include <fmt/format.h>

#include "render_core/error.h"
#include "render_core/scene/byte_source.h"
#include "render_core/scene/first_sight.h"
#include "render_core/scene/load_context.h"
#include "render_core/scene/ply.h"
#include "render_core/scene/sanitize.h"
#include "render_core/scene/scene.h"

namespace catgs {

namespace {

struct Decoded {
  std::string format;
  GaussianCloud cloud;
};

constexpr std::string_view supported = "supported: .ply (3DGS)";

Decoded read_file(const std::filesystem::path& path, const LoadContext& context) {
  const FileSource file(path);
  std::array<char, 4> magic{};
  file.read(
      0, std::as_writable_bytes(std::span(magic).first(std::min<std::uint64_t>(4, file.size()))));
  const std::string_view start(magic.data(), magic.size());
  if (start.starts_with("ply")) {
    const PlyHeader header = read_ply_header(file);
    return {"3DGS ply", read_ply(file, header, context)};
  }
  throw InputError(path.string(), "", "is no scene of a known format", supported);
}

}  // namespace

Scene load_scene(const std::filesystem::path& path, const LoadOptions& options) {
  ThreadPool pool(options.threads);
  const LoadContext context(pool, options.progress);
  if (!std::filesystem::exists(path)) throw InputError(path.string(), "", "does not exist");

  Decoded decoded = read_file(path, context.part(0.0, 0.9));
  Scene scene;
  scene.name = path.stem().string();
  scene.format = std::move(decoded.format);
  scene.cloud = std::move(decoded.cloud);
  scene.report = sanitize(scene.cloud, context.part(0.9, 1.0));
  if (scene.cloud.empty())
    throw InputError(path.string(), "",
                     fmt::format("none of its {} Gaussians can be drawn", scene.report.read));
  scene.hints = estimate_hints(scene.cloud);
  context.report(1.0);
  return scene;
}

}  // namespace catgs

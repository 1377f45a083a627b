#include "server/scenes/tree_builder.h"

#include <cstdint>
#include <memory>

#include "render_core/base/thread_pool.h"
#include "render_core/scene/files/scene_parts.h"
#include "render_core/scene/formats/load_context.h"
#include "render_core/scene/tree/build_tree.h"

namespace catgs {
namespace {

/// A scene that is loaded for its tree.
void build_whole(const TreeBuild& build, const std::shared_ptr<ThreadPool>& pool,
                 const std::function<void(double)>& progress) {
  constexpr double loaded = 0.3;  // of the time, about
  LoadOptions options = build.levels;
  options.up = build.up;
  options.keep_view = build.keep_view;
  options.first_view = build.keep_view != nullptr;
  options.threads = build.threads;
  options.progress = [&](double fraction) { progress(loaded * fraction); };
  const Scene scene = load_scene(build.scene, options);
  const SceneParts whole{[&](const auto& take) {
                           take(scene.cloud);
                           return std::uint64_t{scene.report.dropped};
                         },
                         scene.format, true, scene.hints.origin};
  build_tree(whole, build.out, build.memory_bytes, *pool,
             LoadContext(*pool, progress).part(loaded, 1.0));
}

}  // namespace

void build_scene_tree(const TreeBuild& build, const std::function<void(double)>& progress) {
  constexpr std::uint64_t part_rows = 1'000'000;
  const auto pool = std::make_shared<ThreadPool>(build.threads);
  progress(0.0);
  const bool all_levels = !build.levels.lod && !build.levels.gaussian_budget;
  LoadOptions options;
  options.up = build.up;
  options.keep_view = build.keep_view;
  // That of levels needs no more than a few of them, whenever it is asked for.
  const bool first_view = build.keep_view != nullptr && !build.scene.has_levels();
  auto parted =
      all_levels ? scene_in_parts(build.scene, options, pool, part_rows, first_view) : std::nullopt;
  if (!parted) return build_whole(build, pool, progress);
  // Reading a large scene takes minutes, and build_tree() reports only when it is through.
  double reported = 0.0;
  parted->parts.each = [&, each = parted->parts.each](const auto& take) {
    return each([&](const GaussianCloud& part) {
      progress(reported);
      take(part);
    });
  };
  build_tree(parted->parts, build.out, build.memory_bytes, *pool,
             LoadContext(*pool, [&](double fraction) { progress(reported = fraction); }));
}

}  // namespace catgs

#include "render_core/scene/files/load_scene.h"

#include <algorithm>
#include <memory>
#include <utility>

#include <fmt/format.h>
#include <glm/common.hpp>

#include "render_core/base/error.h"
#include "render_core/scene/files/sanitize.h"
#include "render_core/scene/files/view_sample.h"
#include "render_core/scene/formats/format_limits.h"
#include "render_core/scene/formats/json_field.h"
#include "render_core/scene/formats/load_context.h"
#include "render_core/scene/formats/losses.h"
#include "render_core/scene/transform.h"
#include "render_core/scene/tree/read_tree.h"

namespace catgs {

namespace {

DecodedScene read_location(const SceneLocation& location, const LoadOptions& options,
                           const LoadContext& context) {
  const SceneFormat& format = *location.format;
  if (!location.has_levels()) return format.read(location.files, context);
  const OpenLevels scene = format.open_levels(location.files.open(), location.files.index,
                                              options.lod, options.gaussian_budget, max_gaussians);
  return read_about_origin([&](const glm::dvec3& origin) -> DecodedScene {
    return {scene.format, read_levels(scene, context, origin), scene.notes};
  });
}

constexpr float origin_error = 1e-4f;  // what an origin promises at most, world units

/// One origin does not serve a scene whose parts are far apart.
void note_rounding(const GaussianCloud& cloud, std::vector<std::string>& notes) {
  std::size_t rounded = 0;
  float largest = 0.0f;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const glm::vec3 far = glm::abs(cloud.mean[i]);
    const float step = std::max({far.x, far.y, far.z}) * 0x1p-23f;
    if (step <= std::max(middle_scale(cloud.scale[i]), origin_error)) continue;
    ++rounded;
    largest = std::max(largest, step);
  }
  if (rounded > 0)
    notes.push_back(fmt::format(
        "{} of {} Gaussians are smaller than the steps of floats so far from the others "
        "(up to {:.3g}); split the scene into its parts",
        rounded, cloud.size(), largest));
}

}  // namespace

Scene load_scene(const std::filesystem::path& path, const LoadOptions& options) {
  return load_scene(locate_scene(path), options);
}

Scene load_scene(const SceneLocation& location, const LoadOptions& options) {
  const auto pool = std::make_shared<ThreadPool>(options.threads);
  const LoadContext context(*pool, options.progress);
  if (!location.has_levels() && (options.lod || options.gaussian_budget))
    throw InputError(location.given.string(), "", "has no levels of detail to choose from",
                     "levels and budgets are for streamed SOG, 3D Tiles, LCC and LCC2");

  Scene scene;
  scene.name = to_utf8(location.name);
  DecodedScene decoded = read_location(location, options, context.part(0.0, 0.9));
  scene.format = std::move(decoded.format);
  scene.cloud = std::move(decoded.cloud);
  scene.notes = std::move(decoded.notes);
  HintFiles hints = location.hints;
  hints.orbit = decoded.orbit;
  hints.origin = decoded.origin;
  hints.usual_up = decoded.usual_up;
  if (!location.is_in_pages()) {  // whose pages are about the origin that their header has
    const glm::dvec3 left = find_origin(scene.cloud.mean);
    move_origin(scene.cloud, left);
    hints.origin += left;
  }
  // Surfels of a tree are flat already, and their axes are in another order.
  const bool is_flat = location.is_in_pages() && scene.cloud.model == SplatModel::surfels;
  use_model(hints, options.model, scene.cloud.model, scene.notes);
  if (scene.cloud.model == SplatModel::surfels && !is_flat) flatten(scene.cloud);
  scene.report = sanitize(scene.cloud, context.part(0.9, 1.0));
  if (scene.cloud.empty())
    throw InputError(location.given.string(), "",
                     fmt::format("none of its {} Gaussians can be drawn", scene.report.read));
  if (options.first_view || tell_anything(hints))
    scene.hints = find_hints(
        [&] {
          // Levels that are not loaded may be missing. What is loaded can be seen all the same.
          try {
            const LoadContext reading(*pool);
            if (auto levels = view_sample(location, scene.cloud.model, hints.origin, reading))
              return *std::move(levels);
          } catch (const InputError& error) {
            scene.notes.push_back(
                fmt::format("its first view is that of what is loaded: {}", error.what()));
          }
          return view_sample(scene.cloud);
        },
        hints, options.up, scene.notes, pool, options.keep_view);
  scene.hints.origin = hints.origin;
  note_origin(hints.origin, scene.notes);
  note_rounding(scene.cloud, scene.notes);
  context.report(1.0);
  return scene;
}

SceneInPages open_in_pages(const SceneLocation& location, const LoadOptions& options) {
  if (!location.is_in_pages())
    throw InputError(location.given.string(), "", "is not a tree, so it has no detail to choose",
                     "make one with catgs-render convert IN OUT.tree");
  return open_in_pages(location.files.path, location, options);
}

SceneInPages open_in_pages(const std::filesystem::path& tree, const SceneLocation& made_of,
                           const LoadOptions& options) {
  const auto pool = std::make_shared<ThreadPool>(options.threads);
  const LoadContext context(*pool, options.progress);
  SceneInPages scene;
  scene.tree = std::make_shared<TreeFile>(std::make_unique<FileSource>(tree));
  SplatModel model = scene.tree->model();
  use_model(made_of.hints, options.model, model, scene.outline.notes);
  if (model == SplatModel::surfels && scene.tree->model() != model)
    throw InputError(tree.string(), "model", "cannot be made 2dgs in pages",
                     "convert the scene with --model 2dgs");
  scene.tree->set_model(model);
  TreeScene outline = read_tree(*scene.tree, outline_gaussians, context.part(0.0, 0.9));
  scene.outline.name = to_utf8(made_of.name);
  scene.outline.format = "tree";
  scene.outline.cloud = std::move(outline.cloud);
  scene.outline.notes.insert(scene.outline.notes.end(), outline.notes.begin(), outline.notes.end());
  const TreeHeader& header = scene.tree->header();
  scene.outline.report = {.read = header.read, .dropped = header.dropped};
  HintFiles hints = made_of.hints;
  hints.origin = header.origin;
  const GaussianCloud& all = scene.outline.cloud;
  scene.outline.hints = find_hints(
      [&] {
        auto levels = made_of.has_levels()
                          ? view_sample(made_of, all.model, hints.origin, LoadContext(*pool))
                          : std::nullopt;
        return levels ? *std::move(levels) : view_sample(all);
      },
      hints, options.up, scene.outline.notes, pool, options.keep_view);
  note_origin(hints.origin, scene.outline.notes);
  context.report(1.0);
  return scene;
}

}  // namespace catgs

#include "render_core/scene/files/scene_parts.h"

#include <functional>
#include <utility>

#include "render_core/base/even_sample.h"
#include "render_core/scene/files/sanitize.h"
#include "render_core/scene/files/view_sample.h"
#include "render_core/scene/formats/format_limits.h"
#include "render_core/scene/formats/load_context.h"
#include "render_core/scene/keep_if.h"
#include "render_core/scene/transform.h"

namespace catgs {
namespace {

/// The sample is the coarsest level, which costs little to read. So a single level is no scene in
/// parts.
std::optional<DecodedParts> levels_in_parts(const SceneLocation& location,
                                            const LoadContext& context) {
  const auto files = location.files.open();
  const auto open = [&](std::optional<int> level, std::uint64_t most) {
    return location.format->open_levels(files, location.files.index, level, std::nullopt, most);
  };
  const OpenLevels scene = open(std::nullopt, TreeShape::max_gaussians);
  if (scene.levels == 1) return std::nullopt;
  const OpenLevels coarsest = open(scene.levels - 1, max_gaussians);
  DecodedScene sample = read_about_origin([&](const glm::dvec3& origin) -> DecodedScene {
    return {.format = {}, .cloud = read_levels(coarsest, context, origin)};
  });
  DecodedParts parts{scene.format, scene.parts,  {}, std::move(sample.cloud),
                     scene.notes,  sample.origin};
  parts.read = [read = scene.read, origin = sample.origin](
                   std::uint64_t part, const auto& reading) { return read(part, origin, reading); };
  const EvenSample even(parts.sample.size(), DecodedParts::most_sampled);
  keep_if(parts.sample, [&](std::size_t i) { return even.contains(i); });
  return parts;
}

std::optional<DecodedParts> open_parts(const SceneLocation& location, std::uint64_t part_rows,
                                       const LoadContext& context) {
  if (location.has_levels()) return levels_in_parts(location, context);
  if (!location.format->read_parts) return std::nullopt;
  return location.format->read_parts(location.files, part_rows, TreeShape::max_gaussians, context);
}

}  // namespace

std::optional<PartedScene> scene_in_parts(const SceneLocation& location, const LoadOptions& options,
                                          const std::shared_ptr<ThreadPool>& pool,
                                          std::uint64_t part_rows, bool wants_hints) {
  const LoadContext context(*pool);
  std::optional<DecodedParts> parts = open_parts(location, part_rows, context);
  if (!parts) return std::nullopt;
  PartedScene scene;
  scene.notes = std::move(parts->notes);
  GaussianCloud& sample = parts->sample;
  use_model(location.hints, options.model, sample.model, scene.notes);
  if (sample.model == SplatModel::surfels) flatten(sample);
  const SaneReach reach = sane_reach(sample);
  sanitize(sample, reach, context);

  scene.parts.format = parts->format;
  scene.parts.each = [read = parts->read, count = parts->count, used = sample.model, reach,
                      pool](const auto& take) {
    const LoadContext reading(*pool);
    std::uint64_t dropped = 0;
    for (std::uint64_t i = 0; i < count; ++i) {
      GaussianCloud part = read(i, reading);
      part.model = used;
      if (used == SplatModel::surfels) flatten(part);
      dropped += sanitize(part, reach, reading).dropped;
      take(part);
    }
    return dropped;
  };
  const auto sample_all = [&] {
    auto levels = view_sample(location, sample.model, parts->origin, context);
    if (levels) return *std::move(levels);
    return view_sample(location.format->size(location.files).gaussians,
                       [&](const auto& take) { scene.parts.each(take); });
  };
  HintFiles hints = location.hints;
  hints.origin = parts->origin;
  hints.usual_up = parts->usual_up;
  if (wants_hints && !sample.empty())
    scene.hints = find_hints(sample_all, hints, options.up, scene.notes, pool, options.keep_view);
  scene.hints.origin = scene.parts.origin = parts->origin;
  note_origin(parts->origin, scene.notes);
  scene.sample = std::move(sample);
  return scene;
}

}  // namespace catgs

#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "render_core/base/thread_pool.h"
#include "render_core/scene/files/load_scene.h"
#include "render_core/scene/scene.h"
#include "render_core/scene/tree/build_tree.h"

namespace catgs {

/// A scene that is read in parts.
struct PartedScene {
  SceneParts parts;                // as load_scene() has them; they keep the file open
  GaussianCloud sample;            // an even sample of at most 2^16
  SceneHints hints;                // as load_scene() finds them; if wanted; the origin in any case
  std::vector<std::string> notes;  // as Scene::notes
};

/// The scene at a location if its format can be read in parts: a binary 3DGS .ply, a .splat, or a
/// scene of several levels, of which each file of the finest is a part. It may have
/// TreeShape::max_gaussians. Throws InputError when such a scene is wrong. Of `options`, `up`,
/// `model` and `keep_view` count. For hints that nobody keeps, a file is read once more.
/// `part_rows`: Gaussians of a file's part before faulty ones are dropped.
std::optional<PartedScene> scene_in_parts(const SceneLocation& location, const LoadOptions& options,
                                          const std::shared_ptr<ThreadPool>& pool,
                                          std::uint64_t part_rows = 1'000'000,
                                          bool wants_hints = true);

}  // namespace catgs

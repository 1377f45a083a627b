#pragma once

#include <functional>
#include <memory>

#include "render_core/base/thread_pool.h"
#include "render_core/scene/files/load_scene.h"
#include "render_core/scene/files/scene_parts.h"
#include "render_core/scene/gaussian_cloud.h"
#include "render_core/scene/scene.h"

namespace catgs {

/// A scene whose Gaussians are taken part by part, whatever its format.
struct SceneByParts {
  SceneHints hints;
  std::shared_ptr<const GaussianCloud> sample;  // an even one of them, or all
  std::function<void(const std::function<void(const GaussianCloud&)>& take)> each;
};

SceneByParts by_parts(PartedScene scene);
/// The scene is in memory, so it is one part.
SceneByParts by_parts(Scene scene);
/// The leaves of a tree, 2^18 Gaussians at a time.
SceneByParts by_parts(const SceneInPages& scene, std::shared_ptr<ThreadPool> pool);

}  // namespace catgs

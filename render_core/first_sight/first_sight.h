#pragma once

#include <memory>

#include "render_core/base/thread_pool.h"
#include "render_core/scene/gaussian_cloud.h"
#include "render_core/scene/scene.h"

namespace catgs {

/// Hints for a scene that comes with none, given its up (unit). A scene that surrounds free space
/// is seen from inside, from where most is to see; any other one is seen whole, from the side with
/// most detail. Small pictures by the CPU core decide among the candidates. Deterministic.
/// `stands_for`: of an even sample, so many Gaussians of the scene each.
SceneHints estimate_hints(const GaussianCloud& cloud, const glm::vec3& up,
                          std::shared_ptr<ThreadPool> pool, float stands_for = 1.0f);

}  // namespace catgs

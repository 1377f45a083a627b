#pragma once

#include <cstdint>
#include <functional>
#include <optional>

#include "render_core/base/even_sample.h"
#include "render_core/scene/files/locate_scene.h"
#include "render_core/scene/formats/load_context.h"
#include "render_core/scene/gaussian_cloud.h"

namespace catgs {

/// The Gaussians of a scene from which its first view is estimated. They are the same whatever part
/// of the scene is loaded: an even sample of a file's, of levels that a fixed budget chooses, or of
/// a tree's outline. Sanitized, and without view dependence.
struct ViewSample {
  static constexpr std::uint64_t most = std::uint64_t{1} << 20;

  GaussianCloud cloud;
  float stands_for = 1.0f;  // so many Gaussians of the scene each
};

/// That of a file without levels, from all its Gaussians, which are sanitized.
ViewSample view_sample(const GaussianCloud& whole);

/// The same for a scene that is read part by part. `gaussians`: of the file.
ViewSample view_sample(
    std::uint64_t gaussians,
    const std::function<void(const std::function<void(const GaussianCloud&)>& take)>& each);

/// That of a scene with levels, or of a tree: reads what it needs. Nothing for other formats.
/// `model`: of the loaded scene. Throws InputError.
/// `origin`: of the loaded scene, in the file's coordinates; a tree has its own.
std::optional<ViewSample> view_sample(const SceneLocation& scene, SplatModel model,
                                      const glm::dvec3& origin, const LoadContext& context);

}  // namespace catgs

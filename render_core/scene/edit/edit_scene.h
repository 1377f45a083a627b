#pragma once

#include <cstddef>
#include <optional>

#include <glm/gtc/quaternion.hpp>
#include <glm/vec3.hpp>

#include "render_core/base/thread_pool.h"
#include "render_core/scene/formats/load_context.h"
#include "render_core/scene/gaussian_cloud.h"
#include "render_core/scene/scene.h"
#include "render_core/scene/transform.h"

namespace catgs {

/// A scene's place in other axes: place' = rotation (scale place) + offset.
struct Placement {
  double scale = 1.0;                       // positive
  glm::dquat rotation{1.0, 0.0, 0.0, 0.0};  // unit
  glm::dvec3 offset{0.0};

  [[nodiscard]] bool moves() const;
  [[nodiscard]] AffineMap map() const;
};

struct CropBox {
  glm::dvec3 min{0.0}, max{0.0};
};

/// The steps that edit a scene, in this order. With its defaults it changes nothing.
struct SceneEdit {
  Placement placement{};
  std::optional<CropBox> crop{};  // keeps the Gaussians whose means lie in it, once placed
  bool remove_floaters = false;
  double keep_fraction = 1.0;  // in (0, 1]; see keep_most_important()
  // Gaussians that are left by merging: the smaller of a number (0: no limit) and a share in (0,
  // 1].
  std::size_t merge_to = 0;
  double merge_fraction = 1.0;

  /// Whether a part of a scene can be edited without the others.
  [[nodiscard]] bool works_on_parts() const {
    return !remove_floaters && keep_fraction >= 1.0 && merge_to == 0 && merge_fraction >= 1.0;
  }
};

/// The same edit of places that are about an origin, and the origin that they are about afterwards.
struct EditAboutOrigin {
  SceneEdit edit;
  glm::dvec3 origin{0.0};
};
/// Throws InputError where the placement leads beyond max_coordinate.
EditAboutOrigin about_origin(const SceneEdit& edit, const glm::dvec3& origin);

/// How many Gaussians each step has taken away.
struct EditCounts {
  std::size_t cropped = 0, floaters = 0, pruned = 0, merged = 0;
};

/// Edits a sanitized scene, whose invariants stay. The scene may end up empty. Throws InputError
/// where the placement leads beyond max_coordinate.
EditCounts edit_cloud(GaussianCloud& cloud, const SceneEdit& edit, ThreadPool& pool,
                      const LoadContext& context);

/// The hints of a scene that has been placed, about the same origin. Limits become the box around
/// the turned box. Throws InputError where they lead beyond max_coordinate.
SceneHints placed(const SceneHints& hints, const Placement& placement);

}  // namespace catgs

#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>

#include <glm/vec3.hpp>

#include "render_core/base/thread_pool.h"
#include "render_core/motion/trajectory.h"
#include "render_core/scene/scene.h"

namespace catgs {

/// The place of a scene, and how far from its focus people look at it. An object is seen from
/// outside of its bounds.
struct ScenePosition {
  ScenePosition(const Bounds& robust_bounds, const SceneHints& hints);

  Bounds bounds;  // robust_bounds() of the scene
  glm::vec3 focus;
  float distance;  // of the first view from the focus

  /// Neither in the bounds nor as near to the focus as the first view.
  [[nodiscard]] bool outside(const glm::vec3& position) const;
};

/// Whether a trace is fit for measurements. A camera that looks away from the scene, or has left
/// it, renders fast and well.
struct TraceCheck {
  static constexpr double wanted_frames = 0.95;  // share of the frames that see enough
  static constexpr double enough_in_view = 0.1;  // of the trace's largest in-view count

  std::size_t frames = 0;
  double seeing_frames = 0.0;  // share of the frames that see enough
  std::size_t emptiest_frame = 0;
  double emptiest_in_view = 0.0;   // of the largest in-view count
  std::size_t outside_frames = 0;  // camera outside of the place
  std::optional<std::size_t> first_outside;

  [[nodiscard]] bool valid() const { return seeing_frames >= wanted_frames && outside_frames == 0; }
  /// Names the fault, with both values; empty for a valid trace.
  [[nodiscard]] std::string complaint() const;
};

/// `means` are the centres of the scene's Gaussians. In view are those deeper than the near plane
/// that project into the image of `lens` (its pose is not used). Judged by an even sample of at
/// most 2^17 of them.
TraceCheck check_trace(const Trajectory& trajectory, std::span<const glm::vec3> means,
                       const ScenePosition& point, const Camera& lens, ThreadPool& pool);

}  // namespace catgs

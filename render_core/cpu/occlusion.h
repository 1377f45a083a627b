#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include <glm/vec2.hpp>

#include "render_core/base/thread_pool.h"
#include "render_core/cpu/depth_limits.h"
#include "render_core/math/camera-inl.h"
#include "render_core/math/camera.h"
#include "render_core/scene/clusters.h"

namespace catgs {

struct SimdKernels;

/// Finds what the last frame of a View shows to be hidden in the next one. math/occlusion-inl.h has
/// the method.
class Occlusion {
 public:
  /// Starts a frame: finds its limits, if the last frame is known and near enough.
  /// `mean_inverse_depth`: of the last frame.
  void begin(const Camera& camera, float mean_inverse_depth, const SimdKernels& kernels,
             ThreadPool& pool);
  /// Call after the frame, when the ends of all its tiles are noted.
  void finish() { last_ = now_; }
  /// The next frame will have no limits.
  void forget() { last_.reset(); }

  /// The limits of the frame that has begun.
  [[nodiscard]] DepthLimits limits() const;
  [[nodiscard]] PartEnds ends_of_tile(glm::ivec2 tile);
  /// Whether all Gaussians of a cluster are hidden.
  [[nodiscard]] bool hides(const Cluster& cluster) const;

  [[nodiscard]] std::size_t memory_bytes() const;

 private:
  void spread_ends(int radius, ThreadPool& pool);
  void find_limits(const SimdKernels& kernels, ThreadPool& pool);
  void spread_limits(int level, glm::ivec2 size);

  Camera now_;
  math::CameraModel<float> model_{};  // of now_
  std::optional<Camera> last_;        // whose ends are known
  glm::ivec2 parts_{0}, room_{0};     // parts of the picture, and those of its tiles
  bool limited_ = false;
  int levels_ = 0;  // of limits_
  // Rows of room_.x parts: ends of the last frame, then of this one; the deepest end around, in a
  // row and in all.
  std::vector<float> ends_, deepest_in_row_, deepest_;
  std::vector<float> limits_;  // DepthLimits
};

}  // namespace catgs

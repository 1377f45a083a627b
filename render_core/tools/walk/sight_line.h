#pragma once

#include <vector>

#include <glm/vec3.hpp>

#include "render_core/base/thread_pool.h"
#include "render_core/scene/clusters.h"
#include "render_core/scene/gaussian_cloud.h"

namespace catgs {

/// How much light passes between two places, by the Gaussians themselves: no grid, no tiles. It
/// judges what was computed from cells. Borrows the cloud.
class SightLines {
 public:
  SightLines(const GaussianCloud& cloud, ThreadPool& pool);

  /// The transmittance from `from` to `to` (world). A Gaussian with the alpha a at the nearest
  /// point of the line has the optical depth -ln(1 - a) along the whole line, of which a part
  /// counts: the share of the Gaussian's profile along the line that lies between the two places.
  [[nodiscard]] float light_between(const glm::vec3& from, const glm::vec3& to) const;

 private:
  const GaussianCloud& cloud_;
  std::vector<std::uint32_t> order_;  // Gaussians of like size, along a Morton curve
  std::vector<Cluster> clusters_;     // of cluster_size of them
};

}  // namespace catgs

#pragma once

#include <cstddef>
#include <vector>

#include <glm/vec3.hpp>
#include <hwy/aligned_allocator.h>

#include "render_core/cpu/kernels.h"
#include "render_core/scene/clusters.h"

namespace catgs {

/// Colours of a View's Gaussians from when they were last shaded. A colour depends only on the
/// direction from the camera. A cluster's colours therefore hold until the camera has moved by
/// colour_reuse_rad, as seen from its nearest Gaussian; turning the camera changes none.
class ColourCache {
 public:
  explicit ColourCache(std::size_t clusters);

  /// The known colours of a cluster, for a camera at `position`: none when the camera has moved too
  /// far, or when the cluster belonged to another `page` before. Clusters may be asked for in
  /// parallel, each by one thread at a time.
  ClusterColours of_cluster(std::size_t index, std::uint64_t page, const Cluster& bounds,
                            const glm::vec3& position);

  [[nodiscard]] std::size_t memory_bytes() const;

 private:
  struct Shading {
    glm::vec3 position{0.0f};  // of the camera
    std::uint64_t page = 0;    // of the cluster
    ClusterMembers shaded{};   // colours that are known from `position`
  };
  std::vector<Shading> shadings_;               // [cluster]
  hwy::AlignedFreeUniquePtr<float[]> colours_;  // [cluster][channel][Gaussian]
};

}  // namespace catgs

#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include <glm/vec3.hpp>

#include "render_core/base/host_device.h"
#include "render_core/base/thread_pool.h"
#include "render_core/math/camera.h"
#include "render_core/math/constants.h"
#include "render_core/scene/gaussian_cloud.h"

namespace catgs {

/// Gaussians that are culled together: neighbours along a Morton curve.
inline constexpr std::size_t cluster_size = 256;

constexpr std::size_t clusters_of(std::size_t gaussians) {
  return (gaussians + cluster_size - 1) / cluster_size;
}

/// A Morton curve through a box of 2^21 cells on each axis.
class MortonCurve {
 public:
  /// `low` and `high`: the ends of the box.
  MortonCurve(const glm::vec3& low, const glm::vec3& high);
  /// Place along the curve, 63 bits, of a place in the box.
  [[nodiscard]] std::uint64_t code(const glm::vec3& point) const;

 private:
  glm::dvec3 low_, cells_per_unit_;
};

/// Indices of places along the Morton curve of their box; equal codes keep their order. Applied to
/// a cloud's means, cluster c is the run of indices that starts at c * cluster_size.
std::vector<std::uint32_t> morton_order(std::span<const glm::vec3> positions, ThreadPool& pool);

/// Bounds of a cluster for culling.
struct Cluster {
  glm::vec3 centre;       // of the box around the means, world
  glm::vec3 half_extent;  // of that box
  // Largest distance from a mean, world units, at which one of its Gaussians reaches alpha_min.
  float reach;
};

/// Collects the bounds of a cluster. They hold for the values that are added, so a core adds the
/// values that it draws, after rounding.
class ClusterBounds {
 public:
  /// `sigma`: no less than the Gaussian's largest standard deviation, world units.
  void add(const glm::vec3& mean, double sigma, float log2_opacity);
  /// At least one Gaussian was added.
  [[nodiscard]] Cluster cluster() const;

 private:
  glm::vec3 low_{std::numeric_limits<float>::max()}, high_{std::numeric_limits<float>::lowest()};
  double reach_ = 0.0;
};

/// Half-spaces of the world. A cluster is outside when none of its Gaussians can reach a pixel.
class ClusterCuller {
 public:
  explicit ClusterCuller(const Camera& camera);
  [[nodiscard]] CATGS_HD bool outside(const Cluster& cluster) const { return beyond(cluster) != 0; }

  /// Whether nothing that lies in the cluster's box is outside.
  [[nodiscard]] bool within(const Cluster& cluster) const;

  /// The half-spaces that the cluster lies outside of, a bit each, in the same order for all
  /// cameras.
  [[nodiscard]] CATGS_HD unsigned beyond(const Cluster& cluster) const {
    unsigned beyond = 0;
    for (int i = 0; i < count_; ++i) {
      const HalfSpace& h = half_spaces_[i];
      const float centre = h.normal.x * cluster.centre.x + h.normal.y * cluster.centre.y +
                           h.normal.z * cluster.centre.z + h.offset;
      const float radius = fabsf(h.normal.x) * cluster.half_extent.x +
                           fabsf(h.normal.y) * cluster.half_extent.y +
                           fabsf(h.normal.z) * cluster.half_extent.z;
      const float rounding = 1e-5f * (fabsf(h.offset) + fabsf(centre));
      if (centre + radius + h.reach_factor * cluster.reach + rounding < 0.0f) beyond |= 1u << i;
    }
    return beyond;
  }

 private:
  static constexpr int view_sides = 5,
                       most = view_sides + 6;  // the near plane is one of the view's
  struct HalfSpace {
    glm::vec3 normal;  // towards the image
    float offset;
    float reach_factor;  // inward shift of the half-space per world unit of a Gaussian's reach
  };
  HalfSpace half_spaces_[most];
  int count_ = view_sides;
};

/// Whether a cluster is outside all the way from one camera to another. A straight path through
/// camera space that has both ends outside of one half-space lies outside of it.
CATGS_HD inline bool outside_on_the_way(const ClusterCuller& now, const ClusterCuller& end,
                                        const Cluster& cluster) {
  const unsigned beyond = now.beyond(cluster);
  return beyond != 0 && (beyond & end.beyond(cluster)) != 0;
}

/// Whether colours shaded for a camera at `shaded_from` are accurate for one at `position`: no
/// direction to a Gaussian of the cluster has turned by more than colour_reuse_rad.
CATGS_HD inline bool colours_hold(const Cluster& cluster, const glm::vec3& shaded_from,
                                  const glm::vec3& position) {
  const auto squared = [](float x, float y, float z) { return x * x + y * y + z * z; };
  const auto beyond = [](float at, float centre, float half_extent) {
    return fmaxf(fabsf(at - centre) - half_extent, 0.0f);
  };
  const float from_box = squared(beyond(position.x, cluster.centre.x, cluster.half_extent.x),
                                 beyond(position.y, cluster.centre.y, cluster.half_extent.y),
                                 beyond(position.z, cluster.centre.z, cluster.half_extent.z));
  const float moved =
      squared(position.x - shaded_from.x, position.y - shaded_from.y, position.z - shaded_from.z);
  return moved <= static_cast<float>(colour_reuse_rad * colour_reuse_rad) * from_box;
}

}  // namespace catgs

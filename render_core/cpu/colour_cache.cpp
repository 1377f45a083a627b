#include "render_core/cpu/colour_cache.h"

#include <algorithm>
#include <new>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "render_core/math/constants.h"

namespace catgs {
namespace {

constexpr std::size_t floats_per_cluster = 3 * cluster_size;

}  // namespace

ColourCache::ColourCache(std::size_t clusters)
    : shadings_(clusters),
      colours_(
          hwy::AllocateAligned<float>(std::max<std::size_t>(1, clusters) * floats_per_cluster)) {
  if (!colours_) throw std::bad_alloc();
}

ClusterColours ColourCache::of_cluster(std::size_t index, const Cluster& bounds,
                                       const glm::vec3& position) {
  Shading& shading = shadings_[index];
  const glm::vec3 from_box =
      glm::max(glm::abs(position - bounds.centre) - bounds.half_extent, glm::vec3(0.0f));
  const float moved = glm::distance(position, shading.position);
  if (moved > static_cast<float>(colour_reuse_rad) * glm::length(from_box)) {
    shading = {position, {}};
  }
  return {colours_.get() + index * floats_per_cluster, &shading.shaded};
}

std::size_t ColourCache::memory_bytes() const {
  return shadings_.size() * (sizeof(Shading) + floats_per_cluster * sizeof(float));
}

}  // namespace catgs

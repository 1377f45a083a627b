#include "render_core/cpu/colour_cache.h"

#include <algorithm>
#include <cassert>
#include <new>

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

ClusterColours ColourCache::of_cluster(std::size_t index, std::uint64_t page, const Cluster& bounds,
                                       const glm::vec3& position) {
  assert(index < shadings_.size());
  Shading& shading = shadings_[index];
  if (shading.page != page || !colours_hold(bounds, shading.position, position))
    shading = {position, page, {}};
  return {colours_.get() + index * floats_per_cluster, &shading.shaded};
}

std::size_t ColourCache::memory_bytes() const {
  return shadings_.size() * (sizeof(Shading) + floats_per_cluster * sizeof(float));
}

}  // namespace catgs

#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "render_core/base/thread_pool.h"
#include "render_core/scene/clusters.h"
#include "render_core/scene/gaussian_cloud.h"

namespace catgs::test {

/// The Gaussians of these indices, in this order.
inline GaussianCloud picked(const GaussianCloud& from, const std::vector<std::uint32_t>& indices) {
  GaussianCloud to;
  to.model = from.model;
  to.resize(indices.size(), from.sh_degree);
  const auto count = static_cast<std::size_t>(from.sh_count());
  for (std::size_t i = 0; i < indices.size(); ++i) {
    const std::uint32_t k = indices[i];
    to.mean[i] = from.mean[k];
    to.rotation[i] = from.rotation[k];
    to.scale[i] = from.scale[k];
    to.opacity[i] = from.opacity[k];
    std::copy_n(from.sh_of(k), count, &to.sh[i * count]);
  }
  return to;
}

/// The cloud as cores hold it: cluster after cluster.
inline GaussianCloud in_cluster_order(const GaussianCloud& cloud, ThreadPool& pool) {
  return picked(cloud, morton_order(cloud.mean, pool));
}

}  // namespace catgs::test

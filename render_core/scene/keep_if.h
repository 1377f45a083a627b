#pragma once

#include <algorithm>
#include <cassert>
#include <cstddef>

#include "render_core/scene/gaussian_cloud.h"

namespace catgs {

/// Removes every Gaussian i for which keep(i) is false. The order of the others stays, and so do
/// the vectors' allocations.
template <class Keep>
void keep_if(GaussianCloud& cloud, const Keep& keep) {
  assert(cloud.sizes_agree());
  const std::size_t sh_count = cloud.sh_count();
  std::size_t kept = 0;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    if (!keep(i)) continue;
    if (kept != i) {
      cloud.mean[kept] = cloud.mean[i];
      cloud.rotation[kept] = cloud.rotation[i];
      cloud.scale[kept] = cloud.scale[i];
      cloud.opacity[kept] = cloud.opacity[i];
      std::copy_n(cloud.sh.begin() + i * sh_count, sh_count, cloud.sh.begin() + kept * sh_count);
    }
    ++kept;
  }
  cloud.resize(kept, cloud.sh_degree);
}

}  // namespace catgs

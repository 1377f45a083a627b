#pragma once

#include <algorithm>
#include <cassert>
#include <cstddef>

#include "render_core/scene/gaussian_cloud.h"

namespace catgs {

/// Stores the Gaussians of `from` from Gaussian `first` of `to` on, which has room for them. `to`
/// may have a higher SH degree: its other coefficients stay as they are.
inline void copy_gaussians(const GaussianCloud& from, std::size_t first, GaussianCloud& to) {
  assert(first + from.size() <= to.size() && from.sh_degree <= to.sh_degree);
  const auto copy = [first](const auto& source, auto& target) {
    std::copy(source.begin(), source.end(), target.begin() + static_cast<std::ptrdiff_t>(first));
  };
  copy(from.mean, to.mean);
  copy(from.rotation, to.rotation);
  copy(from.scale, to.scale);
  copy(from.opacity, to.opacity);
  const auto stride = static_cast<std::size_t>(to.sh_count());
  for (std::size_t i = 0; i < from.size(); ++i)
    std::copy_n(from.sh_of(i), from.sh_count(), to.sh.data() + (first + i) * stride);
}

/// The same Gaussians with coefficients up to `sh_degree`, which is at least theirs.
inline GaussianCloud with_sh_degree(GaussianCloud cloud, int sh_degree) {
  if (cloud.sh_degree == sh_degree) return cloud;
  GaussianCloud wider;
  wider.model = cloud.model;
  wider.resize(cloud.size(), sh_degree);
  copy_gaussians(cloud, 0, wider);
  return wider;
}

}  // namespace catgs

#include "render_core/scene/prune.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <vector>

#include "render_core/scene/keep_if.h"

namespace catgs {

void keep_most_important(GaussianCloud& cloud, double fraction) {
  assert(fraction > 0.0 && fraction <= 1.0);
  const auto kept = static_cast<std::size_t>(
      std::ceil(std::clamp(fraction, 0.0, 1.0) * static_cast<double>(cloud.size())));
  if (kept >= cloud.size()) return;
  const auto importance = [&](std::uint32_t i) {
    const glm::vec3& s = cloud.scale[i];
    return cloud.opacity[i] * (s.x * s.y + s.y * s.z + s.z * s.x);
  };
  std::vector<std::uint32_t> order(cloud.size());
  std::iota(order.begin(), order.end(), 0u);
  std::nth_element(order.begin(), order.begin() + static_cast<std::ptrdiff_t>(kept), order.end(),
                   [&](std::uint32_t a, std::uint32_t b) {
                     const float ia = importance(a), ib = importance(b);
                     return ia != ib ? ia > ib : a < b;  // ties by index: the same on every machine
                   });
  std::vector<bool> keep(cloud.size());
  for (std::size_t k = 0; k < kept; ++k) keep[order[k]] = true;
  keep_if(cloud, [&](std::size_t i) { return keep[i]; });
}

}  // namespace catgs

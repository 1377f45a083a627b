#pragma once

#include <cstdint>

#include "render_core/base/thread_pool.h"
#include "render_core/math/camera.h"
#include "render_core/scene/gaussian_cloud.h"

namespace catgs {

/// The work of a frame for any core that lists Gaussians exactly for 16x16 tiles and blends them
/// front to back. Splats that a box of 8x4 pixels, a warp, does not see are left out.
struct WorkCount {
  std::uint64_t list_entries = 0;      // of all tiles
  std::uint64_t reached_entries = 0;   // entries before all pixels of their tile are finished
  std::uint64_t warp_evaluations = 0;  // (entry, box) where the ellipse meets the unfinished box
  std::uint64_t blended_pairs = 0;     // (entry, pixel) blended
};

/// Counts the work from the formulas of math/ alone, independent of any core's lists, bounds or
/// shortcuts.
WorkCount count_work(const GaussianCloud& cloud, const Camera& camera, ThreadPool& pool);

}  // namespace catgs

#pragma once

#include <cstdint>

#include "render_core/base/thread_pool.h"
#include "render_core/math/camera.h"
#include "render_core/scene/gaussian_cloud.h"

namespace catgs {

/// What a frame asks of any core that lists Gaussians for 16x16 tiles exactly, blends them front to
/// back and leaves out what a box of 8x4 pixels, a warp, does not see.
struct WorkCount {
  std::uint64_t list_entries = 0;      // of all tiles
  std::uint64_t reached_entries = 0;   // of them, those before all pixels of their tile finished
  std::uint64_t warp_evaluations = 0;  // (entry, box) where the ellipse meets the unfinished box
  std::uint64_t blended_pairs = 0;     // (entry, pixel) blended
};

/// Counts it, from the formulas of math/ alone: no core's own lists, bounds or shortcuts matter.
WorkCount count_work(const GaussianCloud& cloud, const Camera& camera, ThreadPool& pool);

}  // namespace catgs

#include <algorithm>
#include <bit>
#include <limits>

#include "render_core/cuda/cuda_check.h"
#include "render_core/cuda/frame_output.cuh"

namespace catgs::cuda {

FrameStats frame_stats(const FrameCounts& counts, const FrameShape& shape, FrameKind kind,
                       float near_z) {
  FrameStats stats;
  stats.visible = counts.visible;
  stats.list_entries = std::min(counts.list_entries, shape.list_bound);
  stats.overflowed_entries = counts.list_entries - stats.list_entries;
  stats.list_max = counts.list_max;
  for (const std::uint32_t queued : counts.queued) stats.tasks += queued;
  stats.giants = counts.giants;
  stats.uncarried_lists = counts.uncarried_lists;
  stats.blended_pairs = counts.blended_pairs;
  if (kind == FrameKind::key) stats.displacement_px = std::bit_cast<float>(counts.displacement);
  stats.nearest_depth = counts.nearness == 0 ? std::numeric_limits<float>::infinity()
                                             : std::bit_cast<float>(~counts.nearness);
  if (counts.sampled > 0) {
    const double inverse = static_cast<double>(counts.inverse_depths) / counts.sampled;
    stats.mean_inverse_depth = static_cast<float>(inverse / (near_z * inverse_depth_scale));
  }
  return stats;
}

std::vector<std::uint32_t> tile_loads(const FrameShape& shape, const uint2* ranges) {
  std::vector<uint2> copy(shape.tiles());
  check(cudaMemcpy(copy.data(), ranges, copy.size() * sizeof(uint2), cudaMemcpyDeviceToHost),
        "tile loads");
  std::vector<std::uint32_t> loads;
  for (int y = 0; y < shape.tiles_y; ++y) {
    for (int x = 0; x < shape.tiles_x; ++x) {
      const int x_px = shape.first_x_px + x * tile_size_px;
      const int y_px = shape.first_y_px + y * tile_size_px;
      const uint2& range = copy[static_cast<std::size_t>(y * shape.tiles_x + x)];
      const bool in_image =
          x_px >= 0 && y_px >= 0 && x_px < shape.width_px && y_px < shape.height_px;
      if (in_image) loads.push_back(range.y - range.x);
    }
  }
  return loads;
}

}  // namespace catgs::cuda

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
  stats.nodes = counts.clusters;
  if (counts.levels != 0) {
    stats.finest_level = std::countr_zero(counts.levels);
    stats.coarsest_level = std::bit_width(counts.levels) - 1;
  }
  stats.list_entries = std::min(counts.list_entries, shape.list_bound);
  stats.overflowed_entries = counts.list_entries - stats.list_entries;
  stats.list_max = counts.list_max;
  for (const std::uint32_t queued : counts.queued) stats.tasks += queued;
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

FrameView borrowed_frame(const ViewSettings& settings, const FrameShape& shape,
                         std::byte* host_image, float* rgb) {
  FrameView frame;
  frame.format = settings.format;
  frame.size_px = {shape.width_px, shape.height_px};
  const auto width = static_cast<std::size_t>(shape.width_px);
  const auto height = static_cast<std::size_t>(shape.height_px);
  if (settings.format == PixelFormat::i420) {
    std::byte* cb = host_image + width * height;
    frame.space = MemorySpace::host;
    frame.planes = {Plane{host_image, width}, Plane{cb, width / 2},
                    Plane{cb + width * height / 4, width / 2}};
  } else {
    frame.space = settings.space;
    std::byte* pixels =
        settings.space == MemorySpace::host ? host_image : reinterpret_cast<std::byte*>(rgb);
    frame.planes = {Plane{pixels, 3 * sizeof(float) * width}, Plane{}, Plane{}};
  }
  return frame;
}

std::vector<std::uint32_t> tile_loads(const FrameShape& shape, const uint2* ranges) {
  std::vector<uint2> copy(shape.tiles());
  check(cudaMemcpy(copy.data(), ranges, copy.size() * sizeof(uint2), cudaMemcpyDeviceToHost),
        "tile loads");
  std::vector<std::uint32_t> loads;
  for (const uint2& range : copy) loads.push_back(range.y - range.x);
  return loads;
}

}  // namespace catgs::cuda

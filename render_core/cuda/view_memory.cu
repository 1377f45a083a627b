#include <algorithm>

#include "render_core/cuda/sort.cuh"
#include "render_core/cuda/view_memory.cuh"

namespace catgs::cuda {

std::size_t ViewSizes::scratch_bytes() const {
  if (shape.tiles() == 0) return 0;  // the View has no such lists
  return std::max(sort_scratch_bytes(shape), cull_scratch_bytes(scene.frame_clusters));
}

std::size_t ViewSizes::host_image_bytes() const {
  if (makes_video()) return pixels() + pixels() / 2;
  return settings.space == MemorySpace::host ? 3 * sizeof(float) * pixels() : 0;
}

}  // namespace catgs::cuda

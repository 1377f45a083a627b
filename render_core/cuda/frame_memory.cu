#include "render_core/cuda/frame_memory.cuh"
#include "render_core/cuda/sort.cuh"

namespace catgs::cuda {

void FrameMemory::reserve(const FrameShape& shape, std::size_t scene_blocks,
                          const ViewSettings& settings) {
  records.reserve(shape.visible_bound);
  tile_count.reserve(shape.visible_bound);
  first.reserve(shape.visible_bound);
  for (int i = 0; i < 2; ++i) {
    depth[i].reserve(shape.visible_bound);
    order[i].reserve(shape.visible_bound);
    tile[i].reserve(shape.list_bound);
    slot[i].reserve(shape.list_bound);
  }
  range.reserve(shape.tiles());
  block_state.reserve(scene_blocks + 1);
  counts.reserve(1);
  host_counts.reserve(1);
  scratch.reserve(sort_scratch_bytes(shape));
  const std::size_t pixels = static_cast<std::size_t>(shape.width_px) * shape.height_px;
  rgb.reserve(3 * pixels);
  if (settings.format == PixelFormat::i420) {
    i420.reserve(pixels + pixels / 2);
    host_image.reserve(pixels + pixels / 2);
  } else if (settings.space == MemorySpace::host) {
    host_image.reserve(3 * sizeof(float) * pixels);
  }
}

std::size_t FrameMemory::bytes() const {
  return records.bytes() + tile_count.bytes() + first.bytes() + depth[0].bytes() +
         depth[1].bytes() + order[0].bytes() + order[1].bytes() + tile[0].bytes() +
         tile[1].bytes() + slot[0].bytes() + slot[1].bytes() + range.bytes() + block_state.bytes() +
         counts.bytes() + scratch.bytes() + rgb.bytes() + i420.bytes();
}

}  // namespace catgs::cuda

#include <algorithm>

#include "render_core/cuda/cull.cuh"
#include "render_core/cuda/frame_memory.cuh"
#include "render_core/cuda/sort.cuh"
#include "render_core/cuda/split.cuh"

namespace catgs::cuda {

bool turns_tiles(const ViewSettings& settings) {
  return settings.pipeline == Pipeline::catgs && settings.speculation.initial_window > 0 &&
         settings.speculation.grid == GridKind::warp;
}

void FrameMemory::reserve(const FrameShape& shape, const SceneArrays& scene,
                          const ViewSettings& settings) {
  clusters.reserve(scene.cluster_count);
  cull_mask.reserve(cull_words(scene.cluster_count));
  cull_seen.reserve(scene.cluster_count);
  cull_before.reserve(scene.cluster_count);
  visible.reserve(shape.visible_bound);
  records.reserve(shape.visible_bound);
  spans.reserve(shape.visible_bound);
  if (settings.pipeline == Pipeline::catgs) {
    if (settings.colour_cache) colours.reserve(scene);
    path.reserve(shape.visible_bound);
    if (settings.order == BlendOrder::fresh) {
      runs.reserve(run_bound(shape));
    }
  }
  tile_count.reserve(shape.visible_bound);
  first.reserve(shape.visible_bound);
  for (int i = 0; i < 2; ++i) {
    depth[i].reserve(shape.visible_bound);
    order[i].reserve(shape.visible_bound);
    tile[i].reserve(shape.list_bound);
    slot[i].reserve(shape.list_bound);
  }
  range.reserve(shape.tile_bound);
  tasks.reserve(task_bound(shape));
  queue.reserve(queue_bound(shape));
  tile_slices.reserve(shape.tile_bound);
  const std::size_t slices = shape.slice_bound;
  consumed.reserve(slices * static_cast<unsigned>(shape.tile_parts));
  slice_transmittance.reserve(slices * static_cast<unsigned>(shape.tile_parts));
  slice_pixels.reserve(slices * run_bound_px(shape));
  for (auto& of_frame : reach) of_frame.reserve(shape.tile_bound);
  if (turns_tiles(settings)) {
    pixels.reserve(static_cast<std::size_t>(shape.tile_bound) * run_bound_px(shape));
    pixel_count.reserve(shape.tile_bound);
  }
  scratch.reserve(std::max(sort_scratch_bytes(shape), cull_scratch_bytes(scene.cluster_count)));
  reserve_image(shape, settings);
}

void FrameMemory::reserve_image(const FrameShape& shape, const ViewSettings& settings) {
  counts.reserve(1);
  host_counts.reserve(1);
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
  return colours.bytes() + clusters.bytes() + cull_mask.bytes() + cull_seen.bytes() +
         cull_before.bytes() + visible.bytes() + tasks.bytes() + queue.bytes() +
         tile_slices.bytes() + spans.bytes() + path.bytes() + runs.bytes() + consumed.bytes() +
         slice_transmittance.bytes() + slice_pixels.bytes() + reach[0].bytes() + reach[1].bytes() +
         pixels.bytes() + pixel_count.bytes() + records.bytes() + tile_count.bytes() +
         first.bytes() + depth[0].bytes() + depth[1].bytes() + order[0].bytes() + order[1].bytes() +
         tile[0].bytes() + tile[1].bytes() + slot[0].bytes() + slot[1].bytes() + range.bytes() +
         counts.bytes() + scratch.bytes() + rgb.bytes() + i420.bytes();
}

}  // namespace catgs::cuda

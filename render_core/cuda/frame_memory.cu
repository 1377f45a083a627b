#include "render_core/cuda/frame_memory.cuh"
#include "render_core/cuda/giants.cuh"
#include "render_core/cuda/split.cuh"

namespace catgs::cuda {

bool speculates(const ViewSettings& settings) {
  return settings.pipeline == Pipeline::catgs && settings.speculation.initial_window > 0;
}

bool turns_tiles(const ViewSettings& settings) {
  return speculates(settings) && settings.speculation.grid == GridKind::warp;
}

void FrameMemory::reserve(const FrameShape& shape, const SceneArrays& scene,
                          const ViewSettings& settings) {
  if (settings.pipeline == Pipeline::catgs) {
    if (settings.colour_cache) colours.reserve(scene);
    if (settings.order == BlendOrder::fresh) {
      runs.reserve(run_bound(shape));
      ordered.reserve(shape.tile_bound);
      giants.reserve(giant_words);
    }
  }
  tasks.reserve(task_bound(shape));
  queue.reserve(queue_bound(shape));
  tile_slices.reserve(shape.tile_bound);
  const std::size_t slices = shape.slice_bound;
  consumed.reserve(slices * static_cast<unsigned>(shape.tile_parts));
  slice_transmittance.reserve(slices * static_cast<unsigned>(shape.tile_parts));
  slice_pixels.reserve(slices * run_bound_px(shape));
  if (turns_tiles(settings)) {
    pixels.reserve(static_cast<std::size_t>(shape.tile_bound) * run_bound_px(shape));
    pixel_count.reserve(shape.tile_bound);
  }
  reserve_image(shape, settings);
}

void FrameMemory::reserve_image(const FrameShape& shape, const ViewSettings& settings) {
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
  return colours.bytes() + tasks.bytes() + queue.bytes() + consumed.bytes() + pixels.bytes() +
         pixel_count.bytes() + tile_slices.bytes() + runs.bytes() + ordered.bytes() +
         giants.bytes() + slice_transmittance.bytes() + slice_pixels.bytes() + rgb.bytes() +
         i420.bytes();
}

}  // namespace catgs::cuda

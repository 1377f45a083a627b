#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "render_core/cuda/frame_arrays.cuh"
#include "render_core/frame/renderer.h"

namespace catgs::cuda {

/// Statistics of a finished frame from its counts: all but kind, window and times. `near_z`: of the
/// frame's camera.
FrameStats frame_stats(const FrameCounts& counts, const FrameShape& shape, FrameKind kind,
                       float near_z);

/// The picture in a View's memory, without its statistics. `rgb`: device memory; `host_image`: its
/// copy on the host, or that of the planes for an encoder.
FrameView borrowed_frame(const ViewSettings& settings, const FrameShape& shape,
                         std::byte* host_image, float* rgb);

/// As View::tile_loads(), on the current device. `ranges`: [tiles], device memory. Waits for the
/// device; throws CudaError.
std::vector<std::uint32_t> tile_loads(const FrameShape& shape, const uint2* ranges);

}  // namespace catgs::cuda

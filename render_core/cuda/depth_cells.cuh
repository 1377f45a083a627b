#pragma once

#include <glm/vec2.hpp>

#include "render_core/cuda/device_buffer.h"
#include "render_core/cuda/frame_arrays.cuh"
#include "render_core/frame/depth_grid.h"

namespace catgs::cuda {

/// The lists of a frame, for its depths.
struct DepthSource {
  FrameShape shape;
  const uint2* range;          // [tiles]: list entries
  const TileEntry* entries;    // [list_bound], front to back within a tile
  const SplatRecord* records;  // [visible_bound]
  const float* splat_depth;    // likewise, view depth
};

/// Makes the depth grid of a frame. A warp follows the light of a pixel down the list of its tile,
/// 32 entries at a time, until half of it is stopped. A cell has the second nearest of four pixels.
/// The blend would need registers that it does not have.
class DepthCells {
 public:
  /// Starts to make the grid; `cells`: 0: none. Throws CudaError.
  void find(const DepthSource& source, glm::ivec2 cells, cudaStream_t stream);
  /// The grid, once the stream has come so far; valid until the next find().
  [[nodiscard]] DepthGrid grid() const;
  [[nodiscard]] std::size_t bytes() const { return device_.bytes(); }

 private:
  glm::ivec2 cells_{0};
  Buffer<float, MemoryKind::pooled> device_;
  Buffer<float, MemoryKind::pinned> host_;
};

}  // namespace catgs::cuda

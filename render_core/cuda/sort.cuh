#pragma once

#include "render_core/cuda/frame_arrays.cuh"

namespace catgs::cuda {

/// Radix sorts by CUB. Counts stay on the device: the host passes bounds, and what lies between a
/// count and its bound is padded with keys that sort last.

/// Ping-pong buffers; CUB says which of the two holds the result.
template <class T>
struct PingPong {
  T* current = nullptr;
  T* other = nullptr;
};

struct SortScratch {
  void* memory = nullptr;
  std::size_t bytes = 0;
};

/// Scratch that every call below needs at most for these bounds.
std::size_t sort_scratch_bytes(const FrameShape& shape);

/// Sorts visible splats front to back, stable: on return order.current[k] is the slot of the k-th
/// nearest. `depth` holds `counts->visible` keys; both arrays have shape.visible_bound entries.
void sort_by_depth(const FrameShape& shape, const FrameCounts* counts,
                   PingPong<std::uint32_t>& depth, PingPong<std::uint32_t>& order,
                   SortScratch scratch, cudaStream_t stream);

/// first[k] = sum of tile_count[order[j]] over j < k: where the k-th splat writes its list entries.
/// Sets counts->list_entries.
void scan_tile_counts(const FrameShape& shape, FrameCounts* counts, const std::uint32_t* order,
                      const std::uint32_t* tile_count, std::uint32_t* first, SortScratch scratch,
                      cudaStream_t stream);

/// Sorts list entries by tile, stable, so that each tile keeps its front-to-back order. Keys beyond
/// the count must be shape.tiles() or more.
void sort_by_tile(const FrameShape& shape, PingPong<std::uint32_t>& tile,
                  PingPong<std::uint32_t>& slot, SortScratch scratch, cudaStream_t stream);

}  // namespace catgs::cuda

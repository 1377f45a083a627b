#pragma once

#include <bit>

#include "render_core/cuda/frame_arrays.cuh"

namespace catgs::cuda {

/// Radix sorts by CUB, of exactly as many elements as there are: see HostCounts.

/// Bits of a depth key. 16 bits give 6 % more frames, but surfaces that nearly touch change places:
/// 55 dB to this order, and 23 dB in the worst block (one H100, fungi_room head1).
constexpr int depth_bits = 24;
constexpr std::uint32_t most_depth_key = (1u << depth_bits) - 1u;

/// Key of a view depth; 0 for one not beyond the near plane. Positive floats sort like their bits,
/// so the keys are nearly logarithmic: 20 octaves from the near plane in steps of 1e-6. Splats
/// within a step keep the order of the scene's clusters.
__host__ __device__ inline std::uint32_t depth_key(float depth, float near_z) {
  constexpr int octaves = 20, bits_per_octave = 23;
  constexpr std::uint64_t scale =
      (std::uint64_t{1} << (32 + depth_bits - bits_per_octave)) / octaves;
  if (!(depth > near_z)) return 0;
  const std::uint64_t steps =
      std::bit_cast<std::uint32_t>(depth) - std::bit_cast<std::uint32_t>(near_z);
  const auto key = static_cast<std::uint32_t>(steps * scale >> 32);
  return key < most_depth_key ? key : most_depth_key;
}

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

/// Upper bound of the scratch that sort_by_depth(), scan_tile_counts() and sort_by_tile() need for
/// these bounds.
std::size_t sort_scratch_bytes(const FrameShape& shape);

/// Sorts `visible` splats front to back, stable. On return order.current[k] is the slot of the k-th
/// nearest. `order` must hold 0, 1, 2, ….
void sort_by_depth(std::uint32_t visible, PingPong<std::uint32_t>& depth,
                   PingPong<std::uint32_t>& order, SortScratch scratch, cudaStream_t stream);

/// first[k] = sum of tile_count[order[j]] over j < k: where the k-th splat writes its list entries.
/// Sets list_entries of both counts.
void scan_tile_counts(std::uint32_t visible, FrameCounts* counts, HostCounts* host_counts,
                      const std::uint32_t* order, const std::uint32_t* tile_count,
                      std::uint32_t* first, SortScratch scratch, cudaStream_t stream);

/// Sorts `entries` list entries by tile, stable, so that each tile keeps its front-to-back order.
/// Keys are at most shape.tiles(). Tile: std::uint16_t or std::uint32_t.
template <class Tile>
void sort_by_tile(const FrameShape& shape, std::uint32_t entries, PingPong<Tile>& tile,
                  PingPong<TileEntry>& entry, SortScratch scratch, cudaStream_t stream);

/// For the vanilla pipeline: sums[i] = tile_count[0] + … + tile_count[i], and a sort of list
/// entries by 64-bit (tile | depth) keys.
std::size_t sum_scratch_bytes(std::uint32_t count);
std::size_t key_sort_scratch_bytes(std::uint32_t entries, const FrameShape& shape);
void sum_tile_counts(std::uint32_t count, const std::uint32_t* tile_count, std::uint32_t* sums,
                     SortScratch scratch, cudaStream_t stream);
void sort_by_key(std::uint32_t entries, const FrameShape& shape, PingPong<std::uint64_t>& key,
                 PingPong<std::uint32_t>& slot, SortScratch scratch, cudaStream_t stream);

}  // namespace catgs::cuda

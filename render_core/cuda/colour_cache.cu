#include "render_core/cuda/colour_cache.cuh"
#include "render_core/cuda/cuda_check.h"
#include "render_core/cuda/early_launch.cuh"
#include "render_core/scene/clusters.h"

namespace catgs::cuda {
namespace {

constexpr int block_size = 128;
constexpr std::uint32_t words_per_cluster = cluster_size / warp_size;

/// One thread per cluster.
__global__ void __launch_bounds__(block_size) want_colours_kernel(const WantColoursParams p) {
  let_next_kernel_begin();
  const std::uint32_t rank = blockIdx.x * block_size + threadIdx.x;
  if (rank >= p.counts->clusters) return;
  const std::uint32_t c = p.clusters[rank];
  const bool hold = colours_hold(p.scene.clusters[c], p.colours.shaded_from[c], p.position);
  if (!hold) p.colours.shaded_from[c] = p.position;
  const std::uint32_t* visible = &p.mask[rank * words_per_cluster];
  std::uint32_t* known = &p.colours.known[c * words_per_cluster];
  std::uint32_t* wanted = &p.colours.wanted[c * words_per_cluster];
#pragma unroll
  for (std::uint32_t w = 0; w < words_per_cluster; ++w) {
    const std::uint32_t kept = hold ? known[w] : 0;
    wanted[w] = visible[w] & ~kept;
    known[w] = visible[w] | kept;
  }
}

}  // namespace

void forget_colours(const ColourArrays& colours, std::uint32_t cluster_count, cudaStream_t stream) {
  const auto clear = [&](void* array, std::size_t bytes) {
    check(cudaMemsetAsync(array, 0, bytes, stream), "colour cache");
  };
  clear(colours.shaded_from, cluster_count * sizeof(glm::vec3));
  clear(colours.known, cluster_count * words_per_cluster * sizeof(std::uint32_t));
}

void launch_want_colours(const WantColoursParams& params, cudaStream_t stream) {
  const std::uint32_t blocks = blocks_for(params.scene.cluster_count, block_size);
  if (blocks == 0) return;
  want_colours_kernel<<<blocks, block_size, 0, stream>>>(params);
  check_launch("colour cache");
}

}  // namespace catgs::cuda

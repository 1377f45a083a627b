#include <cub/device/device_scan.cuh>
#include <thrust/iterator/transform_iterator.h>

#include "render_core/cuda/cuda_check.h"
#include "render_core/cuda/cull.cuh"

namespace catgs::cuda {
namespace {

constexpr int block_size = 256;

/// A warp a word: no thread waits for another, so that loads of the scene are all that it takes.
template <bool sweeps>
__global__ void __launch_bounds__(block_size) mask_kernel(const CullParams p) {
  const std::uint32_t i = blockIdx.x * block_size + threadIdx.x;
  bool visible = false;
  if (i < p.scene.count) {
    visible = make_splat<sweeps>(p.scene, p.camera, p.shape, i, load_centre(p.scene, i)).in_view;
  }
  const unsigned word = __ballot_sync(~0u, visible);
  if (threadIdx.x % warp_size == 0) p.mask[i / warp_size] = word;
}

struct BitsOf {
  __host__ __device__ std::uint32_t operator()(std::uint32_t word) const {
#if defined(__CUDA_ARCH__)
    return static_cast<std::uint32_t>(__popc(word));
#else
    return static_cast<std::uint32_t>(__builtin_popcount(word));
#endif
  }
};

__global__ void __launch_bounds__(block_size) compact_kernel(const CullParams p) {
  const std::uint32_t i = blockIdx.x * block_size + threadIdx.x;
  const std::uint32_t lane = threadIdx.x % warp_size;
  const std::uint32_t word = p.mask[i / warp_size];
  const std::uint32_t before = p.before[i / warp_size];
  const std::uint32_t at = before + BitsOf{}(word & ((1u << lane) - 1u));
  if ((word >> lane & 1u) != 0 && at < p.shape.visible_bound) p.visible[at] = i;
  if (i + 1 == gridDim.x * block_size) p.counts->visible = before + BitsOf{}(word);
}

auto bits_of(const std::uint32_t* mask) { return thrust::make_transform_iterator(mask, BitsOf{}); }

}  // namespace

std::uint32_t cull_words(std::uint32_t count) {
  return blocks_for(count, block_size) * (block_size / warp_size);
}

std::size_t cull_scratch_bytes(std::uint32_t count) {
  std::size_t bytes = 0;
  check(cub::DeviceScan::ExclusiveSum(nullptr, bytes, bits_of(nullptr),
                                      static_cast<std::uint32_t*>(nullptr), cull_words(count)),
        "cull scratch size");
  return bytes;
}

void launch_cull(const CullParams& params, cudaStream_t stream) {
  const std::uint32_t words = cull_words(params.scene.count);
  if (words == 0) return;
  const auto kernel = params.sweeps ? mask_kernel<true> : mask_kernel<false>;
  kernel<<<words * warp_size / block_size, block_size, 0, stream>>>(params);
  check_launch("cull");
  std::size_t bytes = params.scratch.bytes;
  check(cub::DeviceScan::ExclusiveSum(params.scratch.memory, bytes, bits_of(params.mask),
                                      params.before, words, stream),
        "cull scan");
  compact_kernel<<<words * warp_size / block_size, block_size, 0, stream>>>(params);
  check_launch("cull compaction");
}

}  // namespace catgs::cuda

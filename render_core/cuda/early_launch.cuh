#pragma once

#include <cstdint>

#include <cuda_runtime.h>

#include "render_core/cuda/cuda_check.h"

namespace catgs::cuda {

// A frame is a row of mostly short kernels. One that is launched early has its blocks on the
// processors before the kernel before it ends, and begins some microseconds sooner: see
// programmatic dependent launch in the CUDA programming guide. (One H200, hon_sui_sen: 1 % more
// frames of head2 a second, 0.3 % of drone.)

/// Whether this code of the kernel waits: what a newer device compiled from code for an older one
/// does not. Throws CudaError.
inline bool launches_early(const void* kernel, const char* stage) {
  cudaFuncAttributes attributes{};
  check(cudaFuncGetAttributes(&attributes, kernel), stage);
  return attributes.ptxVersion >= 90;
}

/// Launches a kernel of which every thread calls wait_for_earlier_work() before it does anything
/// that others see, or returns. Early is it only behind a kernel that calls
/// let_next_kernel_begin(). `stage`: as for check(). Throws CudaError.
template <class Params>
void launch_early(const char* stage, void (*kernel)(Params), std::uint32_t blocks,
                  std::uint32_t block_size, cudaStream_t stream, const Params& params) {
  cudaLaunchAttribute early{};
  early.id = cudaLaunchAttributeProgrammaticStreamSerialization;
  early.val.programmaticStreamSerializationAllowed = 1;
  cudaLaunchConfig_t config{};
  config.gridDim = blocks;
  config.blockDim = block_size;
  config.stream = stream;
  config.attrs = &early;
  config.numAttrs = launches_early(reinterpret_cast<const void*>(kernel), stage) ? 1 : 0;
  check(cudaLaunchKernelEx(&config, kernel, params), stage);
}

/// Waits until the kernel before is done and can be seen. All before that is too, for it waited
/// itself or was begun when they were done.
__device__ inline void wait_for_earlier_work() {
#if __CUDA_ARCH__ >= 900
  asm volatile("griddepcontrol.wait;" ::: "memory");
#endif
}

/// Lets the next kernel of the stream begin, up to its own wait, once all blocks of this one have.
__device__ inline void let_next_kernel_begin() {
#if __CUDA_ARCH__ >= 900
  asm volatile("griddepcontrol.launch_dependents;");
#endif
}

}  // namespace catgs::cuda

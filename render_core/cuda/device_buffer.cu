#include <cstdint>

#include "render_core/cuda/device_buffer.h"

namespace catgs::cuda {
namespace {

/// The current device's pool; null where it has none, as on some virtual devices.
cudaMemPool_t pool_of_device() {
  int device = 0, has_pool = 0;
  cudaMemPool_t pool = nullptr;
  if (cudaGetDevice(&device) != cudaSuccess ||
      cudaDeviceGetAttribute(&has_pool, cudaDevAttrMemoryPoolsSupported, device) != cudaSuccess ||
      has_pool == 0 || cudaDeviceGetDefaultMemPool(&pool, device) != cudaSuccess)
    return nullptr;
  return pool;
}

}  // namespace

void keep_pool() {
  const cudaMemPool_t pool = pool_of_device();
  if (pool == nullptr) return;
  std::uint64_t bytes = UINT64_MAX;
  check(cudaMemPoolSetAttribute(pool, cudaMemPoolAttrReleaseThreshold, &bytes), "memory pool");
}

void trim_pool() noexcept {
  if (const cudaMemPool_t pool = pool_of_device(); pool != nullptr)
    (void)cudaMemPoolTrimTo(pool, 0);
}

void RawBuffer::reserve_bytes(std::size_t bytes) {
  if (bytes <= bytes_) return;
  release();
  if (kind_ == MemoryKind::pinned) {
    check(cudaHostAlloc(&data_, bytes, cudaHostAllocDefault), "pinned memory");
  } else if (kind_ == MemoryKind::pooled && pool_of_device() != nullptr) {
    check(cudaMallocAsync(&data_, bytes, cudaStreamLegacy), "device memory");
    check(cudaStreamSynchronize(cudaStreamLegacy), "device memory");  // other streams will use it
  } else {
    check(cudaMalloc(&data_, bytes), "device memory");
  }
  bytes_ = bytes;
}

void RawBuffer::release() noexcept {
  // cudaFree() gives memory of a pool back to it, and does not wait then.
  (void)(kind_ == MemoryKind::pinned ? cudaFreeHost(data_) : cudaFree(data_));
  data_ = nullptr;
  bytes_ = 0;
}

}  // namespace catgs::cuda

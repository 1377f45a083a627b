#pragma once

#include <cstddef>
#include <utility>

#include <cuda_runtime_api.h>

#include "render_core/cuda/cuda_check.h"

namespace catgs::cuda {

/// Owns `size()` elements of device memory (or, when `pinned`, of page-locked host memory). Grows
/// by `reserve`, never shrinks, never keeps its contents when growing.
template <class T, bool pinned = false>
class Buffer {
 public:
  Buffer() = default;
  ~Buffer() { release(); }
  Buffer(Buffer&& other) noexcept
      : data_(std::exchange(other.data_, nullptr)), size_(std::exchange(other.size_, 0)) {}
  Buffer& operator=(Buffer&& other) noexcept {
    std::swap(data_, other.data_);
    std::swap(size_, other.size_);
    return *this;
  }

  /// Makes room for `count` elements; throws CudaError and is then empty.
  void reserve(std::size_t count) {
    if (count <= size_) return;
    release();
    void* memory = nullptr;
    if constexpr (pinned) {
      check(cudaHostAlloc(&memory, count * sizeof(T), cudaHostAllocDefault), "pinned memory");
    } else {
      check(cudaMalloc(&memory, count * sizeof(T)), "device memory");
    }
    data_ = static_cast<T*>(memory);
    size_ = count;
  }

  [[nodiscard]] T* get() const { return data_; }
  [[nodiscard]] std::size_t size() const { return size_; }
  [[nodiscard]] std::size_t bytes() const { return size_ * sizeof(T); }

 private:
  void release() noexcept {
    if constexpr (pinned) {
      (void)cudaFreeHost(data_);
    } else {
      (void)cudaFree(data_);
    }
    data_ = nullptr;
    size_ = 0;
  }

  T* data_ = nullptr;
  std::size_t size_ = 0;
};

template <class T>
using DeviceBuffer = Buffer<T, false>;
template <class T>
using PinnedBuffer = Buffer<T, true>;

}  // namespace catgs::cuda

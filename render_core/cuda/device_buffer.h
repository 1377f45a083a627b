#pragma once

#include <cstddef>
#include <utility>

#include <cuda_runtime_api.h>

#include "render_core/cuda/cuda_check.h"

namespace catgs::cuda {

/// Owns bytes of device memory, or of page-locked host memory when `pinned`. Grows by `reserve`,
/// and loses its contents when it grows.
class RawBuffer {
 public:
  explicit RawBuffer(bool pinned) : pinned_(pinned) {}
  ~RawBuffer() { release(); }
  RawBuffer(RawBuffer&& other) noexcept
      : pinned_(other.pinned_),
        data_(std::exchange(other.data_, nullptr)),
        bytes_(std::exchange(other.bytes_, 0)) {}
  RawBuffer& operator=(RawBuffer&& other) noexcept {
    swap(other);
    return *this;
  }

  [[nodiscard]] bool pinned() const { return pinned_; }
  [[nodiscard]] std::size_t bytes() const { return bytes_; }

  /// Makes room for this many bytes. After a CudaError it is empty.
  void reserve_bytes(std::size_t bytes) {
    if (bytes <= bytes_) return;
    release();
    if (pinned_) {
      check(cudaHostAlloc(&data_, bytes, cudaHostAllocDefault), "pinned memory");
    } else {
      check(cudaMalloc(&data_, bytes), "device memory");
    }
    bytes_ = bytes;
  }

  void release() noexcept {
    if (pinned_) {
      (void)cudaFreeHost(data_);
    } else {
      (void)cudaFree(data_);
    }
    data_ = nullptr;
    bytes_ = 0;
  }

 protected:
  [[nodiscard]] void* data() const { return data_; }
  void swap(RawBuffer& other) noexcept {
    std::swap(pinned_, other.pinned_);
    std::swap(data_, other.data_);
    std::swap(bytes_, other.bytes_);
  }

 private:
  bool pinned_;
  void* data_ = nullptr;
  std::size_t bytes_ = 0;
};

/// A RawBuffer of `size()` elements.
template <class T, bool is_pinned = false>
class Buffer : public RawBuffer {
 public:
  Buffer() : RawBuffer(is_pinned) {}

  /// Makes room for `count` elements. After a CudaError it is empty.
  void reserve(std::size_t count) { reserve_bytes(count * sizeof(T)); }

  [[nodiscard]] T* get() const { return static_cast<T*>(data()); }
  [[nodiscard]] std::size_t size() const { return bytes() / sizeof(T); }
  /// Exchanges the memory of two buffers.
  void swap(Buffer& other) noexcept { RawBuffer::swap(other); }
};

template <class T>
using DeviceBuffer = Buffer<T, false>;

}  // namespace catgs::cuda

#pragma once

#include <cstddef>
#include <utility>

#include <cuda_runtime_api.h>

#include "render_core/cuda/cuda_check.h"

namespace catgs::cuda {

enum class MemoryKind {
  device,  // cudaMalloc(): for large memory that lives long
  pooled,  // device memory from its pool, which keeps what is released: see keep_pool()
  pinned,  // page-locked host memory
};

/// Makes the current device's pool keep what Views release, because others, or larger pictures,
/// want it soon. Growing a View by cudaMalloc() and cudaFree() made frames of 2 to 4 ms among those
/// of 0.5 ms, and cudaFree() waits for all frames of the device. cudaMalloc() takes what the pool
/// keeps when the device has nothing else.
void keep_pool();
/// Gives what the current device's pool keeps back to the device.
void trim_pool() noexcept;

/// Owns bytes of memory. Grows by `reserve`, and loses its contents when it grows.
class RawBuffer {
 public:
  explicit RawBuffer(MemoryKind kind) : kind_(kind) {}
  ~RawBuffer() { release(); }
  RawBuffer(RawBuffer&& other) noexcept
      : kind_(other.kind_),
        data_(std::exchange(other.data_, nullptr)),
        bytes_(std::exchange(other.bytes_, 0)) {}
  RawBuffer& operator=(RawBuffer&& other) noexcept {
    swap(other);
    return *this;
  }

  [[nodiscard]] bool pinned() const { return kind_ == MemoryKind::pinned; }
  [[nodiscard]] std::size_t bytes() const { return bytes_; }

  /// Makes room for this many bytes. After a CudaError it is empty. The device must be done with
  /// the present ones.
  void reserve_bytes(std::size_t bytes);
  void release() noexcept;

 protected:
  [[nodiscard]] void* data() const { return data_; }
  void swap(RawBuffer& other) noexcept {
    std::swap(kind_, other.kind_);
    std::swap(data_, other.data_);
    std::swap(bytes_, other.bytes_);
  }

 private:
  MemoryKind kind_;
  void* data_ = nullptr;
  std::size_t bytes_ = 0;
};

/// A RawBuffer of `size()` elements.
template <class T, MemoryKind kind>
class Buffer : public RawBuffer {
 public:
  Buffer() : RawBuffer(kind) {}

  /// Makes room for `count` elements. After a CudaError it is empty.
  void reserve(std::size_t count) { reserve_bytes(count * sizeof(T)); }

  [[nodiscard]] T* get() const { return static_cast<T*>(data()); }
  [[nodiscard]] std::size_t size() const { return bytes() / sizeof(T); }
  /// Exchanges the memory of two buffers.
  void swap(Buffer& other) noexcept { RawBuffer::swap(other); }
};

template <class T>
using DeviceBuffer = Buffer<T, MemoryKind::device>;

}  // namespace catgs::cuda

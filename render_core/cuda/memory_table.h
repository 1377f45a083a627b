#pragma once

#include <cstddef>
#include <vector>

#include "render_core/cuda/device_buffer.h"

namespace catgs::cuda {

/// How long the contents of a buffer are needed.
enum class Life {
  view,   // as long as its View, across key frames
  group,  // from a key frame to its last sub-frame
  frame,  // within one frame
};

/// The memory of a View as a table. A derived class declares each buffer once, as a member: its
/// contents, how long they are needed, and its number of elements for given Sizes. Allocation,
/// release and byte counts follow from that.
template <class Sizes>
class MemoryTable {
 public:
  MemoryTable() = default;
  MemoryTable(const MemoryTable&) = delete;
  MemoryTable& operator=(const MemoryTable&) = delete;

  /// Makes room in all rows. Rows grow and never shrink. Returns whether a row of Life::view grew
  /// and so lost its contents. Throws CudaError.
  bool reserve(const Sizes& sizes) {
    bool lost = false;
    for (const Entry& row : rows_) {
      const std::size_t bytes = row.bytes(sizes), had = row.buffer->bytes();
      row.buffer->reserve_bytes(bytes);
      lost = lost || (row.life == Life::view && had > 0 && bytes > had);
    }
    return lost;
  }
  void release() noexcept {
    for (const Entry& row : rows_) row.buffer->release();
  }
  /// Bytes of device memory.
  [[nodiscard]] std::size_t bytes() const {
    std::size_t sum = 0;
    for (const Entry& row : rows_) sum += row.buffer->pinned() ? 0 : row.buffer->bytes();
    return sum;
  }

 protected:
  /// A row of the table. `count`: a lambda without captures, from Sizes to a number of elements.
  template <class T, MemoryKind kind>
  class Row : public Buffer<T, kind> {
   public:
    template <class Count>
    Row(MemoryTable* table, Life life, Count) {
      table->rows_.push_back({this, life, [](const Sizes& sizes) {
                                return static_cast<std::size_t>(Count{}(sizes)) * sizeof(T);
                              }});
    }
  };
  template <class T>
  using DeviceRow = Row<T, MemoryKind::pooled>;
  template <class T>
  using PinnedRow = Row<T, MemoryKind::pinned>;

 private:
  struct Entry {
    RawBuffer* buffer;
    Life life;
    std::size_t (*bytes)(const Sizes&);
  };
  std::vector<Entry> rows_;
};

}  // namespace catgs::cuda

#pragma once

#include <algorithm>
#include <array>
#include <cassert>
#include <cstdint>
#include <utility>
#include <vector>

#include "render_core/base/thread_pool.h"

namespace catgs {

/// An element for RadixSorter, 64 bits in all: an unsigned `key` and the index that it belongs to.
struct CodedIndex {
  std::uint64_t key;
  std::uint32_t value;
};

/// Stable parallel radix sort, least significant digit first. Keeps its histograms from call to
/// call. The result does not depend on the number of threads.
class RadixSorter {
 public:
  /// Sorts `data` by the low `key_bits` bits of the key. `scratch` has the size of `data`; the two
  /// may be swapped.
  template <class Element>
  void sort(std::vector<Element>& data, std::vector<Element>& scratch, int key_bits,
            ThreadPool& pool) {
    const std::size_t count = data.size();
    assert(scratch.size() == count);
    if (count < 2) return;
    const std::size_t parts =
        std::min<std::size_t>(static_cast<std::size_t>(pool.threads()), 1 + count / min_part);
    if (histograms_.size() < parts) histograms_.resize(parts);
    const auto begin_of = [&](std::size_t part) { return count * part / parts; };

    for (int shift = 0; shift < key_bits; shift += digit_bits) {
      pool.parallel_for(parts, [&](std::size_t part) {
        Histogram& histogram = histograms_[part];
        histogram.fill(0);
        for (std::size_t i = begin_of(part); i < begin_of(part + 1); ++i)
          ++histogram[digit(data[i], shift)];
      });
      if (!counts_to_offsets(parts, count)) continue;
      pool.parallel_for(parts, [&](std::size_t part) {
        Histogram& next = histograms_[part];
        for (std::size_t i = begin_of(part); i < begin_of(part + 1); ++i)
          scratch[next[digit(data[i], shift)]++] = data[i];
      });
      std::swap(data, scratch);
    }
  }

 private:
  static constexpr int digit_bits = 11;
  static constexpr std::size_t digits = std::size_t{1} << digit_bits;
  static constexpr std::size_t min_part = 8192;  // elements worth a thread
  using Histogram = std::array<std::uint32_t, digits>;

  template <class Element>
  static std::size_t digit(const Element& e, int shift) {
    return static_cast<std::size_t>(e.key >> shift) & (digits - 1);
  }

  /// Turns counts into the first position of each (digit, part). False when all elements share one
  /// digit, so that nothing has to move.
  bool counts_to_offsets(std::size_t parts, std::size_t count) {
    std::uint32_t offset = 0;
    for (std::size_t d = 0; d < digits; ++d) {
      const std::uint32_t start = offset;
      for (std::size_t part = 0; part < parts; ++part)
        offset += std::exchange(histograms_[part][d], offset);
      if (offset - start == count) return false;
    }
    return true;
  }

  std::vector<Histogram> histograms_;
};

}  // namespace catgs

#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "render_core/thread_pool.h"

namespace catgs {

/// Sort elements: an unsigned `key` and what it belongs to.
struct DepthSlot {
  std::uint32_t key;  // bits of a positive float: they order like the float
  std::uint32_t value;
};
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

  /// Turns counts into the first position of each (digit, part); false when all elements share one
  /// digit, so that there is nothing to move.
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

/// Orders by key; `before` orders elements of equal keys.
template <class Before>
auto in_order_of(const Before& before) {
  return [&before](const DepthSlot& a, const DepthSlot& b) {
    return a.key != b.key ? a.key < b.key : before(a, b);
  };
}

/// Sorts a list of up to some thousands of elements on the calling thread by key; `before` orders
/// elements of equal keys. `scratch` has the size of `data`.
///
/// Two passes over the keys' leading 16 bits within their range bring nearly all elements into
/// place; what shares those bits is sorted by comparison.
template <class Before>
void sort_list(std::span<DepthSlot> data, std::span<DepthSlot> scratch, const Before& before) {
  const auto in_order = in_order_of(before);
  constexpr std::size_t short_list = 24;  // where comparing beats clearing histograms
  if (data.size() <= short_list) return std::sort(data.begin(), data.end(), in_order);

  std::uint32_t low = data.front().key, high = low;
  for (const DepthSlot& e : data) {
    low = std::min(low, e.key);
    high = std::max(high, e.key);
  }
  const int shift = std::max(0, static_cast<int>(std::bit_width(high - low)) - 16);
  const auto leading = [=](const DepthSlot& e) { return (e.key - low) >> shift; };

  std::array<std::uint32_t, 256> next_low{}, next_high{};
  for (const DepthSlot& e : data) {
    ++next_low[leading(e) & 255u];
    ++next_high[leading(e) >> 8];
  }
  std::uint32_t offset_low = 0, offset_high = 0;
  for (std::size_t digit = 0; digit < 256; ++digit) {
    offset_low += std::exchange(next_low[digit], offset_low);
    offset_high += std::exchange(next_high[digit], offset_high);
  }
  for (const DepthSlot& e : data) scratch[next_low[leading(e) & 255u]++] = e;
  for (const DepthSlot& e : scratch) data[next_high[leading(e) >> 8]++] = e;

  for (auto first = data.begin(); first != data.end();) {
    auto last = first + 1;
    while (last != data.end() && leading(*last) == leading(*first)) ++last;
    if (last - first > 1) std::sort(first, last, in_order);
    first = last;
  }
}

/// sort_list() for lists that are nearly in order: by insertion, as long as that is cheaper.
template <class Before>
void sort_list_again(std::span<DepthSlot> data, std::span<DepthSlot> scratch,
                     const Before& before) {
  // In moves, measured: an element out of place costs a mispredicted branch, and sorting anew as
  // much as 8 for each element. The head start keeps the first few from deciding.
  constexpr std::size_t misprediction = 24, sorting_anew = 8, head_start = 512;
  const auto in_order = in_order_of(before);
  std::size_t spent = 0;
  for (std::size_t i = 1; i < data.size(); ++i) {
    const DepthSlot e = data[i];
    if (!in_order(e, data[i - 1])) continue;
    std::size_t at = i;
    for (; at > 0 && in_order(e, data[at - 1]); --at) data[at] = data[at - 1];
    data[at] = e;
    spent += misprediction + (i - at);
    if (spent > sorting_anew * i + head_start) return sort_list(data, scratch, before);
  }
}

}  // namespace catgs

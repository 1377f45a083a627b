#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cassert>
#include <cstdint>
#include <span>
#include <utility>

namespace catgs {

/// An element of a list: a depth as the unsigned `key`, and the slot of the splat that it belongs
/// to.
struct DepthSlot {
  std::uint32_t key;  // bits of a positive float: they order like the float
  std::uint32_t value;
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
/// place. Elements that share those bits are then sorted by comparison.
template <class Before>
void sort_list(std::span<DepthSlot> data, std::span<DepthSlot> scratch, const Before& before) {
  assert(scratch.size() == data.size());
  const auto in_order = in_order_of(before);
  constexpr std::size_t short_list = 24;  // comparing shorter lists beats clearing histograms
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

}  // namespace catgs

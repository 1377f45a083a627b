// The stages that bring a sub-frame's lists into its depth order, on the list of one tile; needs a
// device.

#include <algorithm>
#include <cstdint>
#include <numeric>
#include <string>
#include <tuple>
#include <vector>

#include <gtest/gtest.h>

#include "render_core/cuda/cuda_renderer.h"
#include "render_core/cuda/device_buffer.h"
#include "render_core/cuda/giants.cuh"
#include "render_core/cuda/reorder.cuh"
#include "render_core/cuda/sort.cuh"
#include "render_core/cuda/stream.h"

namespace catgs::cuda {
namespace {

using Slots = std::vector<std::uint32_t>;

/// Keys of depths that the stages tell from each other.
constexpr std::uint32_t key_step = 1u << depth_bits_below;
/// Entries that giants are carried among.
constexpr std::uint32_t giants_reach = 31 * reorder_run;

/// A list in the order of the frame before: that of its slots.
struct TileList {
  explicit TileList(std::uint32_t length) : length(length), ordered(length), key(length) {
    for (std::uint32_t slot = 0; slot < length; ++slot) key[slot] = 2 * (slot + 1) * key_step;
  }
  /// Gives a slot a depth just behind that of another.
  void put_behind(std::uint32_t slot, std::uint32_t other) {
    key[slot] = (2 * (other + 1) + 1) * key_step;
  }
  [[nodiscard]] Slots slots() const {
    Slots all(length);
    std::iota(all.begin(), all.end(), 0u);
    return all;
  }

  std::uint32_t length, ordered;  // entries, and how many of them are to be in order
  Slots key;                      // of slots
  Slots giants;
};

template <class T>
PinnedBuffer<T> pinned(const std::vector<T>& values) {
  PinnedBuffer<T> buffer;
  buffer.reserve(std::max<std::size_t>(values.size(), 1));
  std::copy(values.begin(), values.end(), buffer.get());
  return buffer;
}

struct Drawn {
  Slots slots;
  std::uint32_t uncarried = 0;  // FrameCounts::uncarried_lists
};

/// The list after both stages.
Drawn put_in_order(const TileList& list) {
  FrameShape shape;
  shape.tiles_x = shape.tiles_y = 1;
  FrameCounts counts;
  counts.giants = static_cast<std::uint32_t>(list.giants.size());
  Slots bits(giant_words);
  for (const std::uint32_t slot : list.giants)
    bits[slot / warp_size % giant_words] |= 1u << slot % warp_size;
  std::vector<ReorderRun> runs;
  for (std::uint32_t begin = 0; begin < list.ordered; begin += reorder_run) {
    const std::uint32_t end = std::min(begin + reorder_run, list.ordered);
    runs.push_back({begin, end, begin > 0, end < list.ordered, 0});
  }
  counts.runs = static_cast<std::uint32_t>(runs.size());
  const auto on_device = pinned<FrameCounts>({counts});
  const auto range = pinned<uint2>({make_uint2(0, list.length)});
  const auto ordered = pinned<std::uint32_t>({list.ordered});
  const auto giant_set = pinned(bits), key = pinned(list.key), slot = pinned(list.slots());
  const auto run = pinned(runs);
  int processors = 0;
  check(cudaDeviceGetAttribute(&processors, cudaDevAttrMultiProcessorCount, 0), "device");
  const Stream stream;
  launch_giants({shape, giant_set.get(), range.get(), ordered.get(), key.get(), slot.get(),
                 on_device.get(), processors},
                stream.get());
  launch_reorder({run.get(), on_device.get(), key.get(), slot.get(), processors}, stream.get());
  check(cudaStreamSynchronize(stream.get()), "both stages");
  return {{slot.get(), slot.get() + list.length}, on_device.get()->uncarried_lists};
}

/// Those of a list that are not hidden, the first `count` of them.
Slots seen(const TileList& list, Slots slots, std::size_t count) {
  std::erase_if(slots, [&](std::uint32_t slot) { return list.key[slot] == 0; });
  slots.resize(std::min(slots.size(), count));
  return slots;
}

class ListOrder : public testing::TestWithParam<std::tuple<std::uint32_t, bool>> {
 protected:
  void SetUp() override {
    if (const std::string obstacle = cuda_obstacle(); !obstacle.empty()) GTEST_SKIP() << obstacle;
  }
  /// In order as a whole, or to 7/10 in runs, of which the last is shorter.
  static TileList list() {
    const auto [length, whole] = GetParam();
    TileList list(length);
    if (!whole) list.ordered = std::min(length, (length * 7 / 10 + 127) / 128 * 128);
    return list;
  }
};

// One from the front goes back, one from the back comes to the front; of 40 entries that have come
// behind the near plane some begin a run.
TEST_P(ListOrder, GiantsComeToTheirDepths) {
  TileList list = this->list();
  const std::uint32_t area = std::min(list.ordered, giants_reach);
  list.giants = {area / 8, area * 3 / 4};
  list.put_behind(list.giants[0], area * 13 / 16);
  list.put_behind(list.giants[1], area / 16);
  constexpr std::uint32_t hidden = 20;
  for (const std::uint32_t first : {0u, reorder_run}) {
    if (list.length < 2 * reorder_run) break;
    for (std::uint32_t slot = first; slot < first + hidden; ++slot)
      if (std::ranges::find(list.giants, slot) == list.giants.end()) list.key[slot] = 0;
  }
  const auto [drawn, uncarried] = put_in_order(list);
  Slots expected = list.slots();
  std::ranges::sort(expected, {}, [&](std::uint32_t slot) { return list.key[slot]; });
  const std::size_t front = area * 7 / 8 - std::min(area * 7 / 8, 2 * hidden);
  EXPECT_EQ(seen(list, drawn, front), seen(list, expected, front));
  EXPECT_TRUE(std::ranges::is_permutation(drawn, list.slots()));
  EXPECT_EQ(uncarried, 0u);
}

TEST_P(ListOrder, WhatIsInOrderStays) {
  TileList list = this->list();
  // As many as begin a run and hide where it begins.
  for (std::uint32_t slot = 2 * reorder_run; slot < 2 * reorder_run + reorder_run / 2; ++slot)
    if (slot < list.length) list.giants.push_back(slot);
  // Where runs end, some change places with what begins behind them.
  const std::size_t front = list.ordered < list.length ? list.ordered - 32 : list.length;
  EXPECT_EQ(seen(list, put_in_order(list).slots, front), seen(list, list.slots(), front));
  // All over the list.
  list.giants.clear();
  for (std::uint32_t slot = 0; slot < list.length; slot += 3) list.giants.push_back(slot);
  EXPECT_EQ(seen(list, put_in_order(list).slots, front), seen(list, list.slots(), front));
}

TEST_P(ListOrder, NothingIsLostWhereMoreGiantsMoveThanThereIsRoomFor) {
  TileList list = this->list();
  std::uint32_t random = 1;
  for (std::uint32_t slot = 0; slot < list.length; slot += 2) {
    list.giants.push_back(slot);
    random = random * 1664525u + 1013904223u;
    list.put_behind(slot, random % list.length);
  }
  const auto [drawn, uncarried] = put_in_order(list);
  EXPECT_TRUE(std::ranges::is_permutation(drawn, list.slots()));
  if (list.length > 3 * reorder_run) {
    EXPECT_EQ(uncarried, 1u);
  }
}

INSTANTIATE_TEST_SUITE_P(Lengths, ListOrder,
                         testing::Combine(testing::Values(4u, 511u, 512u, 513u, 1800u, 2561u,
                                                          15'872u, 20'000u),
                                          testing::Bool()));

}  // namespace
}  // namespace catgs::cuda

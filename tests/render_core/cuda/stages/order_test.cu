// The stages that bring a sub-frame's lists into its depth order, on the list of one tile, against
// the CPU core's sort of the same list.

#include <numeric>
#include <tuple>

#include "render_core/cpu/list_sort.h"
#include "render_core/cuda/giants.cuh"
#include "render_core/cuda/reorder.cuh"
#include "tests/render_core/cuda/stages/stage.h"

namespace catgs::cuda::stages {
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
  const auto on_device = upload(std::vector{counts});
  const auto range = upload(std::vector{make_uint2(0, list.length)});
  const auto ordered = upload(std::vector{list.ordered});
  const auto giant_set = upload(bits), key = upload(list.key), slot = upload(list.slots());
  const auto run = upload(runs);
  const Stream stream;
  launch_giants({.shape = shape,
                 .bits = giant_set.get(),
                 .range = range.get(),
                 .ordered = ordered.get(),
                 .depth_key = key.get(),
                 .slot = slot.get(),
                 .counts = on_device.get(),
                 .processors = processors()},
                stream.get());
  launch_reorder({.runs = run.get(),
                  .counts = on_device.get(),
                  .depth_key = key.get(),
                  .slot = slot.get(),
                  .processors = processors()},
                 stream.get());
  return {fetch(slot.get(), list.length), fetch(on_device.get(), 1)[0].uncarried_lists};
}

/// The list as the CPU core sorts it: equal depths in the order of their slots.
Slots on_cpu(const TileList& list) {
  std::vector<DepthSlot> entries, scratch(list.length);
  for (const std::uint32_t slot : list.slots()) entries.push_back({list.key[slot], slot});
  sort_list_again(std::span(entries), std::span(scratch),
                  [](const DepthSlot& a, const DepthSlot& b) { return a.value < b.value; });
  Slots slots;
  for (const DepthSlot& entry : entries) slots.push_back(entry.value);
  return slots;
}

/// Those of a list that are not hidden, the first `count` of them.
Slots seen(const TileList& list, Slots slots, std::size_t count) {
  std::erase_if(slots, [&](std::uint32_t slot) { return list.key[slot] == 0; });
  slots.resize(std::min(slots.size(), count));
  return slots;
}

/// Compares the first `count` places of what is seen of both.
void expect_same(const TileList& list, const Slots& drawn, const Slots& expected,
                 std::size_t count) {
  const Slots a = seen(list, drawn, count), b = seen(list, expected, count);
  ASSERT_EQ(a.size(), b.size());
  Mismatches places("giants, reorder: places of the list", 0.0);
  for (std::size_t k = 0; k < a.size(); ++k) places.add(a[k] != b[k]);
}

class ListOrder : public StageTest,
                  public testing::WithParamInterface<std::tuple<std::uint32_t, bool>> {
 protected:
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
  const std::size_t front = area * 7 / 8 - std::min(area * 7 / 8, 2 * hidden);
  if (front > 0)
    expect_same(list, drawn, on_cpu(list), front);  // a very short list has no such place
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
  expect_same(list, put_in_order(list).slots, on_cpu(list), front);
  // All over the list.
  list.giants.clear();
  for (std::uint32_t slot = 0; slot < list.length; slot += 3) list.giants.push_back(slot);
  expect_same(list, put_in_order(list).slots, on_cpu(list), front);
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
}  // namespace catgs::cuda::stages

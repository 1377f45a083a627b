// The stages that make lists: the two sorts and the scan against the standard library's, entries
// against the CPU core's lists and against every pixel.

#include <map>
#include <numeric>
#include <random>
#include <set>

#include "render_core/cuda/bin.cuh"
#include "render_core/cuda/tile_sort.cuh"
#include "render_core/math/ellipse-inl.h"
#include "tests/render_core/cuda/stages/stage.h"

namespace catgs::cuda::stages {
namespace {

using Numbers = std::vector<std::uint32_t>;

Numbers random_numbers(std::size_t count, std::uint32_t below, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  Numbers numbers(count);
  for (std::uint32_t& number : numbers) number = static_cast<std::uint32_t>(random() % below);
  return numbers;
}

Numbers counting(std::size_t count) {
  Numbers numbers(count);
  std::iota(numbers.begin(), numbers.end(), 0u);
  return numbers;
}

/// Scratch for the sorts of so many splats and entries.
DeviceBuffer<std::byte> scratch_for(const FrameShape& shape) {
  DeviceBuffer<std::byte> scratch;
  scratch.reserve(sort_scratch_bytes(shape));
  return scratch;
}

class SortStage : public StageTest {};

TEST_F(SortStage, OrdersSplatsByDepthAsAStableSort) {
  constexpr std::uint32_t count = 30'000;
  const FrameShape shape{.tiles_x = 4, .tiles_y = 4, .visible_bound = count, .list_bound = 1};
  // Few depths, so that many are equal.
  Numbers keys = random_numbers(count, 5000, 1);
  keys[7] = most_depth_key;
  const auto key = upload(keys), other_key = upload(keys);
  const auto slot = upload(counting(count)), other_slot = upload(Numbers(count));
  const auto scratch = scratch_for(shape);
  const Stream stream;
  PingPong<std::uint32_t> depth{.current = key.get(), .other = other_key.get()};
  PingPong<std::uint32_t> order{.current = slot.get(), .other = other_slot.get()};
  sort_by_depth(count, depth, order, {.memory = scratch.get(), .bytes = scratch.bytes()},
                stream.get());
  Numbers expected = counting(count);
  std::ranges::stable_sort(expected, {}, [&](std::uint32_t i) { return keys[i]; });
  const Numbers drawn = fetch(order.current, count);
  Mismatches positions("sort: places in depth order", 0.0);
  for (std::uint32_t k = 0; k < count; ++k) positions.add(drawn[k] != expected[k]);
}

TEST_F(SortStage, SumsTileCountsInDepthOrder) {
  constexpr std::uint32_t count = 30'000;
  const FrameShape shape{.tiles_x = 4, .tiles_y = 4, .visible_bound = count, .list_bound = 1};
  for (const bool saturates : {false, true}) {
    Numbers tile_counts = random_numbers(count, 40, 2);
    if (saturates) tile_counts[100] = tile_counts[200] = list_entries_limit - 1;
    Numbers order = counting(count);
    std::ranges::shuffle(order, std::mt19937_64(3));
    const auto counted = upload(tile_counts), ordered = upload(order);
    const auto sums = upload(Numbers(count));
    const auto scratch = scratch_for(shape);
    const auto counts = upload(std::vector<FrameCounts>(1));
    Buffer<HostCounts, MemoryKind::pinned> host_counts;
    host_counts.reserve(1);
    const Stream stream;
    scan_tile_counts(count, counts.get(), host_counts.get(), ordered.get(), counted.get(),
                     sums.get(), {.memory = scratch.get(), .bytes = scratch.bytes()}, stream.get());
    const Numbers first = fetch(sums.get(), count);
    Mismatches starts("scan: where entries begin", 0.0);
    std::uint64_t sum = 0;
    for (std::uint32_t k = 0; k < count; ++k) {
      starts.add(first[k] != sum);
      sum = std::min<std::uint64_t>(sum + tile_counts[order[k]], list_entries_limit);
    }
    EXPECT_EQ(fetch(counts.get(), 1)[0].list_entries, sum);
    EXPECT_EQ(host_counts.get()->list_entries, sum);
  }
}

/// Compares the lists of `tiles` tiles with a stable sort of random entries: entry i has tile
/// numbers[i], slot i and blocks ~i, and numbers of `tiles` mean no tile.
void expect_lists(const Numbers& numbers, std::uint32_t tiles, const std::vector<TileEntry>& drawn,
                  const std::vector<uint2>& ranges) {
  Numbers expected = counting(numbers.size());
  std::erase_if(expected, [&](std::uint32_t i) { return numbers[i] >= tiles; });
  std::ranges::stable_sort(expected, {}, [&](std::uint32_t i) { return numbers[i]; });
  Mismatches positions("sort: places in order of tiles", 0.0);
  for (std::size_t k = 0; k < expected.size(); ++k)
    positions.add(drawn[k].slot != expected[k] || drawn[k].blocks != ~expected[k]);

  Mismatches found("ranges: of tiles", 0.0);
  for (std::uint32_t t = 0; t < tiles; ++t) {
    const auto same = [&](std::uint32_t i) { return numbers[i]; };
    const auto of_tile = std::ranges::equal_range(expected, t, {}, same);
    const auto first = static_cast<std::uint32_t>(of_tile.begin() - expected.begin());
    const auto last = static_cast<std::uint32_t>(of_tile.end() - expected.begin());
    found.add(first == last ? ranges[t].x != ranges[t].y
                            : ranges[t].x != first || ranges[t].y != last);
  }
}

std::vector<TileEntry> numbered_entries(std::uint32_t count) {
  std::vector<TileEntry> entries;
  for (std::uint32_t i = 0; i < count; ++i) entries.push_back({i, ~i});
  return entries;
}

template <class Tile>
void expect_sorted_by_tile(glm::ivec2 tiles, cudaStream_t stream) {
  constexpr std::uint32_t count = 50'000;
  const FrameShape shape{
      .tiles_x = tiles.x, .tiles_y = tiles.y, .visible_bound = 1, .list_bound = count};
  const Numbers numbers = random_numbers(count, shape.tiles() + 1, 4);  // the last: padding
  const std::vector<Tile> tile_of(numbers.begin(), numbers.end());
  const auto key = upload(tile_of), other_key = upload(tile_of);
  const auto entry = upload(numbered_entries(count)), other_entry = upload(numbered_entries(count));
  const auto range = upload(std::vector<uint2>(shape.tiles(), make_uint2(1, 2)));
  const auto scratch = scratch_for(shape);
  PingPong<Tile> tile{.current = key.get(), .other = other_key.get()};
  PingPong<TileEntry> sorted{.current = entry.get(), .other = other_entry.get()};
  sort_by_tile(shape, count, tile, sorted, {.memory = scratch.get(), .bytes = scratch.bytes()},
               stream);
  launch_ranges<Tile>(
      {.shape = shape, .entries = count, .tile = tile.current, .range = range.get()}, stream);
  expect_lists(numbers, shape.tiles(), fetch(sorted.current, count),
               fetch(range.get(), shape.tiles()));
}

TEST_F(SortStage, OrdersEntriesByTileAsAStableSortAndFindsTheirRanges) {
  const Stream stream;
  expect_sorted_by_tile<std::uint16_t>({40, 25}, stream.get());
  expect_sorted_by_tile<std::uint16_t>({255, 257}, stream.get());  // 65,535: all bits
  expect_sorted_by_tile<std::uint32_t>({300, 250}, stream.get());
}

/// The number of entries of each window in each tile.
Numbers count_windows(const std::vector<std::uint16_t>& tile_of, std::uint32_t tiles) {
  Numbers in_window((tile_of.size() + list_window - 1) / list_window * tiles);
  for (std::size_t i = 0; i < tile_of.size(); ++i)
    if (tile_of[i] < tiles) ++in_window[i / list_window * tiles + tile_of[i]];
  return in_window;
}

TEST_F(SortStage, OrdersEntriesByTileInOnePass) {
  constexpr std::uint32_t count = 300'000, room = count + 2 * list_window;
  const Stream stream;
  for (const glm::ivec2 tiles : {glm::ivec2(60, 34), glm::ivec2(64, 44), glm::ivec2(1, 1)}) {
    const FrameShape shape{
        .tiles_x = tiles.x, .tiles_y = tiles.y, .visible_bound = 1, .list_bound = room};
    ASSERT_TRUE(sorts_in_one_pass(shape));
    // Half of the entries crowd in few tiles; the largest number means no tile.
    Numbers numbers = random_numbers(count, shape.tiles() + 1, 5);
    for (std::uint32_t i = 0; i < count; i += 2) numbers[i] %= 7;
    const std::vector<std::uint16_t> tile_of(numbers.begin(), numbers.end());
    Numbers in_window = count_windows(tile_of, shape.tiles());
    in_window.resize(window_tiles(shape), ~0u);  // of no use, and not to be read
    const auto counted = upload(in_window);
    FrameCounts counts;
    counts.list_entries = count;
    const auto frame = upload(std::vector<FrameCounts>{counts});
    const auto tile = upload(tile_of);
    const auto unsorted = upload(numbered_entries(count));
    const auto sorted = upload(std::vector<TileEntry>(count));
    const auto range = upload(std::vector<uint2>(shape.tiles(), make_uint2(1, 2)));
    launch_tile_sort({.shape = shape,
                      .counts = frame.get(),
                      .tile = tile.get(),
                      .unsorted = unsorted.get(),
                      .in_window = counted.get(),
                      .entry = sorted.get(),
                      .range = range.get()},
                     stream.get());
    expect_lists(numbers, shape.tiles(), fetch(sorted.get(), count),
                 fetch(range.get(), shape.tiles()));
  }
}

using Entry = std::pair<std::uint32_t, std::uint32_t>;  // tile, index in the cloud

/// The CPU core's lists of the splats that it has in view, by tiles of this core.
std::set<Entry> cpu_entries(const StagedLists& lists) {
  constexpr std::uint32_t ratio = tile_side_px / tile_size_px;
  std::set<Entry> entries;
  const auto on_cpu = lists.on_cpu();
  for (std::uint32_t i = 0; i < on_cpu.size(); ++i) {
    const auto& found = on_cpu[i];
    if (!found) continue;
    std::vector<TileRun> runs;
    const catgs::SplatPath path = found->path.value_or(catgs::SplatPath{});
    simd_kernels().front().list_tiles({.splats = std::span(&found->splat, 1),
                                       .paths = found->path ? &path : nullptr,
                                       .first_slot = 0,
                                       .limits = {}},
                                      runs);
    for (const TileRun& run : runs)
      for (std::uint32_t column = run.begin; column < run.end; ++column)
        entries.emplace(
            run.row / ratio * static_cast<std::uint32_t>(lists.shape().tiles_x) + column / ratio,
            i);
  }
  return entries;
}

/// The blocks of a tile that a splat as it is now reaches in a pixel of the picture, in double
/// precision.
std::uint32_t reached_blocks(const SplatRecord& splat, const FrameShape& shape,
                             std::uint32_t tile) {
  const math::Whitening<double> w{splat.whitening.xx, splat.whitening.xy, splat.whitening.yy};
  const int left = static_cast<int>(tile) % shape.tiles_x * tile_side_px;
  const int top = static_cast<int>(tile) / shape.tiles_x * tile_side_px;
  std::uint32_t blocks = 0;
  for (int y = top; y < std::min(top + tile_side_px, shape.height_px); ++y)
    for (int x = left; x < std::min(left + tile_side_px, shape.width_px); ++x)
      if (splat.log2_opacity - math::whitened_square<double>(
                                   w, {x + 0.5 - splat.centre_px.x, y + 0.5 - splat.centre_px.y}) >=
          log2_alpha_min + 1e-4)
        blocks |= 1u << ((y - top) / block_height_px * blocks_across + (x - left) / block_width_px);
  return blocks;
}

class EmitStage : public ListStage {};

TEST_P(EmitStage, ListsWhatTheCpuCoreListsAndMissesNoPixel) {
  const StagedCase staged(GetParam(), 3000, {160, 96});
  const StagedScene scene(staged.cloud);
  StagedLists lists(scene, staged.camera, staged.plan, staged.settings);
  lists.cull();
  lists.project();
  const ViewMemory& m = lists.memory();
  const std::uint32_t seen = lists.counts().visible;
  const auto keys = fetch(m.depth.get(), seen), visible = fetch(m.visible.get(), seen);
  const auto records = fetch(m.records.get(), seen);
  lists.sort_by_depth();
  lists.emit();
  const FrameCounts counts = lists.counts();
  ASSERT_LE(counts.list_entries, lists.shape().list_bound);
  const auto tiles =
      fetch(reinterpret_cast<const std::uint16_t*>(m.tile.get()), counts.list_entries);
  const auto entries = fetch(m.other_entries.get(), counts.list_entries);
  const Numbers in_window = count_windows(tiles, lists.shape().tiles());
  EXPECT_EQ(fetch(m.in_window.get(), in_window.size()), in_window);

  std::set<Entry> listed;
  std::map<Entry, std::uint32_t> blocks;  // by tile and slot
  std::uint32_t depth = 0;
  for (std::size_t k = 0; k < entries.size(); ++k) {
    const std::uint32_t slot = entries[k].slot;
    if (tiles[k] == lists.shape().tiles()) continue;  // it reaches no block
    EXPECT_GE(keys[slot], depth);                     // in depth order
    depth = keys[slot];
    EXPECT_TRUE(listed.emplace(tiles[k], scene.order[visible[slot]]).second) << "listed twice";
    blocks[{tiles[k], slot}] = entries[k].blocks;
  }
  const std::set<Entry> expected = cpu_entries(lists);
  {
    // Each core widens outlines by its own allowance for rounding. Here, an entry must reach a
    // block; there, the tile, or only the box does where that is one row or column of tiles.
    Mismatches missing("emit: entries of the CPU core that are missing", 0.04);
    for (const Entry& entry : expected) missing.add(!listed.contains(entry));
    Mismatches added("emit: entries that the CPU core does not have", 0.05);
    for (const Entry& entry : listed) added.add(!expected.contains(entry));
  }
  // An outline may meet the rectangle of a block's pixel centres between them.
  Mismatches more("emit: blocks of entries that the splat reaches in no pixel",
                  GetParam() == Listed::now ? 0.15 : 0.6);
  Mismatches missed("emit: blocks that a splat reaches and that are in no entry", 0.0);
  for (std::uint32_t slot = 0; slot < seen; ++slot) {
    for (std::uint32_t t = 0; t < lists.shape().tiles(); ++t) {
      const std::uint32_t reached = reached_blocks(records[slot], lists.shape(), t);
      const auto entry = blocks.find({t, slot});
      const std::uint32_t found = entry == blocks.end() ? 0 : entry->second;
      for (int block = 0; block < 32; ++block) {
        const bool reaches = (reached >> block & 1u) != 0, has = (found >> block & 1u) != 0;
        if (reaches) missed.add(!has);
        if (has) more.add(!reaches);
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(, EmitStage, testing::Values(Listed::now, Listed::window), name_of);

}  // namespace
}  // namespace catgs::cuda::stages

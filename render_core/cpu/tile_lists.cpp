#include "render_core/cpu/tile_lists.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cassert>
#include <numeric>
#include <utility>

namespace catgs {
namespace {

/// Puts runs of equal keys into the order of the scene's clusters.
void order_ties(std::span<const Splat> splats, std::span<CodedIndex> sorted) {
  const auto original = [&](const CodedIndex& e) { return splats[e.value].scene_order; };
  for (auto first = sorted.begin(); first != sorted.end();) {
    auto last = first + 1;
    while (last != sorted.end() && last->key == first->key) ++last;
    if (last - first > 1) std::ranges::sort(first, last, {}, original);
    first = last;
  }
}

/// The calling thread's buffer, enlarged to `size` entries.
std::span<DepthSlot> scratch_of(std::size_t size) {
  thread_local std::vector<DepthSlot> scratch;
  if (scratch.size() < size) scratch.resize(size);
  return std::span(scratch).first(size);
}

/// Orders splats of equal depth.
struct SceneOrder {
  std::span<const Splat> splats;
  bool operator()(const DepthSlot& a, const DepthSlot& b) const {
    return splats[a.value].scene_order < splats[b.value].scene_order;
  }
};

}  // namespace

void TileLists::begin(glm::ivec2 tiles, std::size_t segments, std::uint64_t max_entries) {
  assert(tiles.x > 0 && tiles.y > 0);
  tiles_across_ = tiles.x;
  max_entries_ = max_entries;
  first_left_out_ = nothing_left_out;
  starts_.resize(static_cast<std::size_t>(tiles.x) * static_cast<std::size_t>(tiles.y) + 1);
  segments_.resize(segments);
  clear_segments();
}

void TileLists::clear_segments() {
  runs_ = 0;
  for (Segment& segment : segments_) {
    segment.runs.clear();
    segment.positions.assign(tiles(), 0);
    segment.entries = 0;
  }
}

void TileLists::add(std::size_t segment_index, const ListTask& task, const SimdKernels& kernels) {
  assert(segment_index < segments_.size());
  Segment& segment = segments_[segment_index];
  const std::size_t known = segment.runs.size();
  kernels.list_tiles(task, segment.runs);
  if (first_left_out_ != nothing_left_out) {
    const auto left_out = [&](const TileRun& run) {
      return depth_order(run.entry) >= first_left_out_;
    };
    segment.runs.erase(std::remove_if(segment.runs.begin() + static_cast<std::ptrdiff_t>(known),
                                      segment.runs.end(), left_out),
                       segment.runs.end());
  }
  const std::span added = std::span(segment.runs).subspan(known);
  if (task.first_row > 0)
    for (TileRun& run : added) run.row = static_cast<std::uint16_t>(run.row + task.first_row);
  for (const TileRun& run : added) {
    std::uint32_t* const row = segment.positions.data() + run.row * tiles_across_;
    for (int column = run.begin; column < run.end; ++column) ++row[column];
    segment.entries += run.end - run.begin;
  }
  // More runs than entries fit. finish() will list again, so these would only take memory.
  if (runs_.fetch_add(added.size(), std::memory_order_relaxed) + added.size() > max_entries_)
    segment.runs.resize(known);
}

void TileLists::finish(const SplatTable& table, const SimdKernels& kernels, ThreadPool& pool) {
  std::uint64_t wanted = 0;
  for (const Segment& segment : segments_) wanted += segment.entries;
  if (wanted > max_entries_) list_nearest(table, kernels, pool);
  place_lists();
  overflowed_ = wanted - entries();
  if (entries_.size() < entries()) entries_.resize(entries());

  pool.parallel_for(segments_.size(), [&](std::size_t k) {
    Segment& segment = segments_[k];
    for (const TileRun& run : segment.runs) {
      const std::size_t row =
          static_cast<std::size_t>(run.row) * static_cast<std::size_t>(tiles_across_);
      for (std::size_t tile = row + run.begin; tile < row + run.end; ++tile)
        entries_[starts_[tile] + segment.positions[tile]++] = run.entry;
    }
  });
}

/// Lists everything again without the farthest splats. The usual frame, in which everything fits,
/// thus need not count the entries of each splat.
void TileLists::list_nearest(const SplatTable& table, const SimdKernels& kernels,
                             ThreadPool& pool) {
  const std::size_t ranks = table.counts.size(), shares = segments_.size();
  entries_of_slot_.assign(table.splats.size(), 0);
  pool.parallel_for(ranks, [&](std::size_t rank) {
    thread_local std::vector<TileRun> runs;
    runs.clear();
    kernels.list_tiles(table.of_cluster(rank), runs);
    for (const TileRun& run : runs) entries_of_slot_[run.entry.value] += run.end - run.begin;
  });
  first_left_out_ = find_first_left_out(table, pool);

  clear_segments();
  pool.parallel_for(shares, [&](std::size_t k) {
    for (std::size_t rank = ranks * k / shares; rank < ranks * (k + 1) / shares; ++rank)
      add(k, table.of_cluster(rank), kernels);
  });
}

/// The nearest splat to be left out, together with all behind it, so that the entries of the nearer
/// splats (entries_of_slot_) stay within the bound.
TileLists::DepthOrder TileLists::find_first_left_out(const SplatTable& table, ThreadPool& pool) {
  const auto& [splats, paths, counts, limits, second] = table;
  by_depth_.clear();
  for (std::size_t rank = 0; rank < counts.size(); ++rank)
    for (std::size_t slot = rank * cluster_size; slot < rank * cluster_size + counts[rank]; ++slot)
      by_depth_.push_back(
          {std::bit_cast<std::uint32_t>(splats[slot].depth), static_cast<std::uint32_t>(slot)});
  by_depth_scratch_.resize(by_depth_.size());
  sorter_.sort(by_depth_, by_depth_scratch_, 32, pool);
  std::uint64_t sum = 0;
  for (const DepthSlot& splat : by_depth_) {
    sum += entries_of_slot_[splat.value];
    if (sum > max_entries_) return depth_order(splat);
  }
  return nothing_left_out;
}

/// Turns counts per segment and tile into each segment's first position in the tile's list, and
/// sets starts_.
void TileLists::place_lists() {
  starts_[0] = 0;
  for (std::size_t tile = 0; tile < tiles(); ++tile) {
    std::uint32_t length = 0;
    for (Segment& segment : segments_) length += std::exchange(segment.positions[tile], length);
    starts_[tile + 1] = starts_[tile] + length;
  }
}

void TileLists::sort(std::span<const Splat> splats, ThreadPool& pool) {
  constexpr std::size_t tiles_per_task = 16;
  pool.parallel_for((tiles() + tiles_per_task - 1) / tiles_per_task, [&](std::size_t task) {
    const std::size_t end = std::min(tiles(), (task + 1) * tiles_per_task);
    for (std::size_t tile = task * tiles_per_task; tile < end; ++tile) {
      const std::span<DepthSlot> list{entries_.data() + starts_[tile],
                                      entries_.data() + starts_[tile + 1]};
      sort_list(list, scratch_of(list.size()), SceneOrder{splats});
    }
  });
}

void TileLists::build_by_keys(const SplatTable& table, glm::ivec2 tiles, std::uint64_t max_entries,
                              ThreadPool& pool) {
  assert(tiles.x > 0 && tiles.y > 0);
  const auto& [splats, paths, counts, limits, second] = table;
  const auto tile_count = static_cast<std::size_t>(tiles.x) * static_cast<std::size_t>(tiles.y);
  max_entries_ = max_entries;
  first_left_out_ = nothing_left_out;
  const std::uint64_t wanted = count_keys(table, pool);
  std::uint64_t total = wanted;
  if (wanted > max_entries) {
    first_left_out_ = find_first_left_out(table, pool);
    total = count_keys(table, pool);
  }
  overflowed_ = wanted - total;
  keys_.resize(total);
  key_scratch_.resize(total);

  pool.parallel_for(counts.size(), [&](std::size_t rank) {
    CodedIndex* key = keys_.data() + key_offsets_[rank];
    const int first_row = table.of_cluster(rank).first_row;
    for (std::size_t slot = rank * cluster_size; slot < rank * cluster_size + counts[rank];
         ++slot) {
      if (entries_of_slot_[slot] == 0) continue;
      const Splat& s = splats[slot];
      const std::uint64_t depth = std::bit_cast<std::uint32_t>(s.depth);
      for (int y = first_row + s.tile_y; y < first_row + s.tile_end_y; ++y)
        for (int x = s.tile_x; x < s.tile_end_x; ++x)
          *key++ = {static_cast<std::uint64_t>(y * tiles.x + x) << 32 | depth,
                    static_cast<std::uint32_t>(slot)};
    }
  });
  sorter_.sort(keys_, key_scratch_, 32 + static_cast<int>(std::bit_width(tile_count - 1)), pool);
  order_ties(splats, std::span(keys_));

  starts_.assign(tile_count + 1, 0);
  if (entries_.size() < total) entries_.resize(total);
  for (std::size_t i = 0; i < total; ++i) {
    entries_[i] = {static_cast<std::uint32_t>(keys_[i].key), keys_[i].value};
    ++starts_[(keys_[i].key >> 32) + 1];
  }
  std::partial_sum(starts_.begin(), starts_.end(), starts_.begin());
}

/// Counts the keys of each splat that is not left out (entries_of_slot_) and finds the first key of
/// each cluster (key_offsets_). Returns the sum of the counts.
std::uint64_t TileLists::count_keys(const SplatTable& table, ThreadPool& pool) {
  const auto& [splats, paths, counts, limits, second] = table;
  entries_of_slot_.resize(splats.size());
  key_offsets_.resize(counts.size());
  pool.parallel_for(counts.size(), [&](std::size_t rank) {
    std::uint64_t sum = 0;
    for (std::size_t slot = rank * cluster_size; slot < rank * cluster_size + counts[rank];
         ++slot) {
      const Splat& s = splats[slot];
      const DepthSlot entry{std::bit_cast<std::uint32_t>(s.depth),
                            static_cast<std::uint32_t>(slot)};
      const int area = (s.tile_end_x - s.tile_x) * (s.tile_end_y - s.tile_y);
      const bool kept = depth_order(entry) < first_left_out_;
      sum += entries_of_slot_[slot] = kept ? static_cast<std::uint32_t>(area) : 0;
    }
    key_offsets_[rank] = sum;
  });
  std::uint64_t total = 0;
  for (std::uint64_t& offset : key_offsets_) total += std::exchange(offset, total);
  return total;
}

std::span<const std::uint32_t> TileLists::tiles_by_length() {
  // A counting sort by the number of bits in the length.
  const auto length_class = [&](std::size_t tile) {
    return 64 - std::bit_width(starts_[tile + 1] - starts_[tile]);
  };
  std::array<std::uint32_t, 66> next{};
  for (std::size_t tile = 0; tile < tiles(); ++tile) ++next[length_class(tile) + 1];
  std::partial_sum(next.begin(), next.end(), next.begin());
  tiles_by_length_.resize(tiles());
  for (std::size_t tile = 0; tile < tiles(); ++tile)
    tiles_by_length_[next[length_class(tile)]++] = static_cast<std::uint32_t>(tile);
  return tiles_by_length_;
}

std::uint32_t TileLists::longest() const {
  std::uint64_t length = 0;
  for (std::size_t tile = 0; tile < tiles(); ++tile)
    length = std::max(length, starts_[tile + 1] - starts_[tile]);
  return static_cast<std::uint32_t>(length);
}

std::size_t TileLists::memory_bytes() const {
  const auto bytes = [](const auto& buffer) { return buffer.capacity() * sizeof(buffer[0]); };
  std::size_t sum = bytes(starts_) + bytes(entries_) + bytes(tiles_by_length_) +
                    bytes(entries_of_slot_) + bytes(by_depth_) + bytes(by_depth_scratch_) +
                    bytes(key_offsets_) + bytes(keys_) + bytes(key_scratch_);
  for (const Segment& segment : segments_) sum += bytes(segment.runs) + bytes(segment.positions);
  return sum;
}

}  // namespace catgs

#include "render_core/cpu/tile_lists.h"

#include <algorithm>
#include <array>
#include <bit>
#include <numeric>
#include <utility>

namespace catgs {
namespace {

/// Puts runs of equal keys into the order of the scene.
void order_ties(std::span<const Splat> splats, std::span<CodedIndex> sorted) {
  const auto original = [&](const CodedIndex& e) { return splats[e.value].original_index; };
  for (auto first = sorted.begin(); first != sorted.end();) {
    auto last = first + 1;
    while (last != sorted.end() && last->key == first->key) ++last;
    if (last - first > 1) std::ranges::sort(first, last, {}, original);
    first = last;
  }
}

}  // namespace

void TileLists::begin(glm::ivec2 grid, std::size_t segments, std::uint64_t max_entries) {
  grid_ = grid;
  max_entries_ = max_entries;
  runs_ = 0;
  const auto tile_count = static_cast<std::size_t>(grid.x) * static_cast<std::size_t>(grid.y);
  starts_.resize(tile_count + 1);
  segments_.resize(segments);
  for (Segment& segment : segments_) {
    segment.runs.clear();
    segment.positions.assign(tile_count, 0);
    segment.dropped = 0;
  }
}

void TileLists::add(std::size_t segment_index, std::span<const Splat> splats,
                    std::uint32_t first_slot, const SimdKernels& kernels) {
  Segment& segment = segments_[segment_index];
  const std::size_t known = segment.runs.size();
  kernels.list_tiles(splats, first_slot, segment.runs);
  const std::span added = std::span(segment.runs).subspan(known);
  if (runs_.fetch_add(added.size(), std::memory_order_relaxed) + added.size() > max_entries_) {
    for (const TileRun& run : added) segment.dropped += run.end - run.begin;
    segment.runs.resize(known);
    return;
  }
  for (const TileRun& run : added) {
    std::uint32_t* const row = segment.positions.data() + run.row * grid_.x;
    for (int column = run.begin; column < run.end; ++column) ++row[column];
  }
}

void TileLists::finish(ThreadPool& pool) {
  const std::uint64_t longest_kept = place_lists();
  if (entries_.size() < entries()) entries_.resize(entries());

  pool.parallel_for(segments_.size(), [&](std::size_t k) {
    Segment& segment = segments_[k];
    for (const TileRun& run : segment.runs) {
      const std::size_t row = static_cast<std::size_t>(run.row) * static_cast<std::size_t>(grid_.x);
      for (std::size_t tile = row + run.begin; tile < row + run.end; ++tile) {
        const std::uint32_t position = segment.positions[tile]++;
        if (position < longest_kept) entries_[starts_[tile] + position] = run.entry;
      }
    }
  });
}

/// Turns counts per segment and tile into each segment's first position in the tile's list, and
/// sets starts_. Returns the length that lists are cut to.
std::uint64_t TileLists::place_lists() {
  const std::size_t tile_count = tiles();
  std::uint64_t total = 0, longest_list = 0;
  for (std::size_t tile = 0; tile < tile_count; ++tile) {
    std::uint32_t length = 0;
    for (Segment& segment : segments_) length += std::exchange(segment.positions[tile], length);
    starts_[tile + 1] = length;
    total += length;
    longest_list = std::max<std::uint64_t>(longest_list, length);
  }

  std::uint64_t kept_length = longest_list;
  if (total > max_entries_) {
    const auto total_if_cut = [&](std::uint64_t length) {
      std::uint64_t sum = 0;
      for (std::size_t tile = 0; tile < tile_count; ++tile)
        sum += std::min(starts_[tile + 1], length);
      return sum;
    };
    std::uint64_t fits = 0;
    for (std::uint64_t step = std::bit_floor(longest_list); step != 0; step /= 2)
      if (total_if_cut(fits + step) <= max_entries_) fits += step;
    kept_length = fits;
  }
  starts_[0] = 0;
  for (std::size_t tile = 0; tile < tile_count; ++tile)
    starts_[tile + 1] = starts_[tile] + std::min(starts_[tile + 1], kept_length);
  overflowed_ = total - starts_[tile_count];
  for (const Segment& segment : segments_) overflowed_ += segment.dropped;
  return kept_length;
}

void TileLists::sort(std::span<const Splat> splats, ThreadPool& pool) {
  constexpr std::size_t tiles_per_task = 16;
  pool.parallel_for((tiles() + tiles_per_task - 1) / tiles_per_task, [&](std::size_t task) {
    thread_local std::vector<DepthSlot> scratch;
    const std::size_t end = std::min(tiles(), (task + 1) * tiles_per_task);
    for (std::size_t tile = task * tiles_per_task; tile < end; ++tile) {
      const std::span<DepthSlot> list(entries_.data() + starts_[tile],
                                      entries_.data() + starts_[tile + 1]);
      if (scratch.size() < list.size()) scratch.resize(list.size());
      sort_list(list, std::span(scratch).first(list.size()),
                [&](const DepthSlot& a, const DepthSlot& b) {
                  return splats[a.value].original_index < splats[b.value].original_index;
                });
    }
  });
}

void TileLists::build_by_keys(std::span<const Splat> splats, std::span<const std::uint32_t> counts,
                              glm::ivec2 grid, std::uint64_t max_entries, ThreadPool& pool) {
  const auto tile_count = static_cast<std::size_t>(grid.x) * static_cast<std::size_t>(grid.y);
  const auto for_splats_of = [&](std::size_t rank, auto visit) {
    const std::size_t first = rank * cluster_size;
    for (std::size_t slot = first; slot < first + counts[rank]; ++slot) visit(slot, splats[slot]);
  };
  key_offsets_.resize(counts.size());
  pool.parallel_for(counts.size(), [&](std::size_t rank) {
    std::uint64_t touched = 0;
    for_splats_of(rank, [&](std::size_t, const Splat& s) {
      touched += static_cast<std::uint64_t>((s.tile_end_x - s.tile_x) * (s.tile_end_y - s.tile_y));
    });
    key_offsets_[rank] = touched;
  });
  std::uint64_t wanted = 0;
  for (std::uint64_t& offset : key_offsets_) wanted += std::exchange(offset, wanted);
  const std::uint64_t total = std::min(wanted, max_entries);
  overflowed_ = wanted - total;
  keys_.resize(total);
  key_scratch_.resize(total);

  pool.parallel_for(counts.size(), [&](std::size_t rank) {
    std::uint64_t at = key_offsets_[rank];
    for_splats_of(rank, [&](std::size_t slot, const Splat& s) {
      const std::uint64_t depth = std::bit_cast<std::uint32_t>(s.depth);
      for (int y = s.tile_y; y < s.tile_end_y; ++y)
        for (int x = s.tile_x; x < s.tile_end_x && at < total; ++x, ++at)
          keys_[at] = {static_cast<std::uint64_t>(y * grid.x + x) << 32 | depth,
                       static_cast<std::uint32_t>(slot)};
    });
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

}  // namespace catgs

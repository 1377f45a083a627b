#include "render_core/cpu/tile_lists.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <functional>
#include <numeric>
#include <utility>

#include "render_core/math/ellipse-inl.h"

namespace catgs {
namespace {

/// Calls visit(row, first column, end column) for each row of tiles that the splat's ellipse meets.
template <class Visit>
void for_tile_rows(const Splat& s, const Visit& visit) {
  if (s.tile_end_x - s.tile_x == 1 && s.tile_end_y - s.tile_y == 1) {
    visit(s.tile_y, s.tile_x, s.tile_end_x);
    return;
  }
  const math::Whitening<float> w{s.whitening_xx, s.whitening_xy, s.whitening_yy};
  const auto ellipse = math::make_ellipse(w, math::reach_of(s.log2_opacity), s.half_extent_x);
  constexpr auto side = static_cast<float>(tile_size_px);
  const float leftmost = static_cast<float>(s.tile_x) * side;
  const float rightmost = static_cast<float>(s.tile_end_x) * side - 1.0f;
  for (int row = s.tile_y; row < s.tile_end_y; ++row) {
    const float low_y = static_cast<float>(row) * side + 0.5f - s.centre_y;
    const auto columns = math::columns_in_band(ellipse, low_y, low_y + side - 1.0f);
    // Pixel columns whose centres lie inside; see listing_slack_px.
    const auto slack = static_cast<float>(listing_slack_px);
    const float first = std::ceil(s.centre_x + columns.low - 0.5f - slack);
    const float last = std::floor(s.centre_x + columns.high - 0.5f + slack);
    if (columns.low > columns.high || first > rightmost || last < leftmost || first > last)
      continue;
    visit(row, static_cast<int>(std::max(first, leftmost)) / tile_size_px,
          static_cast<int>(std::min(last, rightmost)) / tile_size_px + 1);
  }
}

template <class Element>
void order_ties_of(std::span<const Splat> splats, std::span<Element> sorted) {
  const auto original = [&](const Element& e) { return splats[e.value].original_index; };
  for (auto first = sorted.begin(); first != sorted.end();) {
    auto last = first + 1;
    while (last != sorted.end() && last->key == first->key) ++last;
    if (last - first > 1) std::ranges::sort(first, last, {}, original);
    first = last;
  }
}

}  // namespace

void order_ties(std::span<const Splat> splats, std::span<DepthSlot> sorted) {
  order_ties_of(splats, sorted);
}
void order_ties(std::span<const Splat> splats, std::span<CodedIndex> sorted) {
  order_ties_of(splats, sorted);
}

void TileLists::build_exact(std::span<const Splat> splats, std::span<const DepthSlot> order,
                            glm::ivec2 grid, std::uint64_t max_entries, ThreadPool& pool) {
  const auto tile_count = static_cast<std::size_t>(grid.x) * static_cast<std::size_t>(grid.y);
  // More segments than threads: the nearest splats, all in the first one, touch the most tiles.
  const std::size_t segments =
      std::min<std::size_t>(static_cast<std::size_t>(pool.threads()) * 4, 1 + order.size() / 1024);
  const auto segment = [&](std::size_t k) {
    const std::size_t begin = order.size() * k / segments;
    return order.subspan(begin, order.size() * (k + 1) / segments - begin);
  };
  starts_.resize(tile_count + 1);
  if (positions_.size() < segments * tile_count) positions_.resize(segments * tile_count);

  pool.parallel_for(segments, [&](std::size_t k) {
    std::uint32_t* const counts = positions_.data() + k * tile_count;
    std::fill_n(counts, tile_count, 0u);
    for (const DepthSlot& entry : segment(k)) {
      for_tile_rows(splats[entry.value], [&](int row, int column, int end) {
        for (; column < end; ++column) ++counts[row * grid.x + column];
      });
    }
  });
  const std::uint64_t longest_kept = place_lists(segments, max_entries);
  if (entries_.size() < entries()) entries_.resize(entries());

  pool.parallel_for(segments, [&](std::size_t k) {
    std::uint32_t* const next = positions_.data() + k * tile_count;
    for (const DepthSlot& entry : segment(k)) {
      for_tile_rows(splats[entry.value], [&](int row, int column, int end) {
        for (; column < end; ++column) {
          const auto tile = static_cast<std::size_t>(row * grid.x + column);
          const std::uint32_t position = next[tile]++;
          if (position < longest_kept) entries_[starts_[tile] + position] = entry.value;
        }
      });
    }
  });
}

/// Turns counts per segment and tile into each segment's first position in the tile's list, and
/// sets starts_. Returns the length that lists are cut to.
std::uint64_t TileLists::place_lists(std::size_t segments, std::uint64_t max_entries) {
  const std::size_t tile_count = tiles();
  std::uint64_t total = 0, longest_list = 0;
  for (std::size_t tile = 0; tile < tile_count; ++tile) {
    std::uint32_t length = 0;
    for (std::size_t k = 0; k < segments; ++k)
      length += std::exchange(positions_[k * tile_count + tile], length);
    starts_[tile + 1] = length;
    total += length;
    longest_list = std::max<std::uint64_t>(longest_list, length);
  }

  std::uint64_t kept_length = longest_list;
  if (total > max_entries) {
    const auto total_if_cut = [&](std::uint64_t length) {
      std::uint64_t sum = 0;
      for (std::size_t tile = 0; tile < tile_count; ++tile)
        sum += std::min(starts_[tile + 1], length);
      return sum;
    };
    std::uint64_t fits = 0;
    for (std::uint64_t step = std::bit_floor(longest_list); step != 0; step /= 2)
      if (total_if_cut(fits + step) <= max_entries) fits += step;
    kept_length = fits;
  }
  starts_[0] = 0;
  for (std::size_t tile = 0; tile < tile_count; ++tile)
    starts_[tile + 1] = starts_[tile] + std::min(starts_[tile + 1], kept_length);
  overflowed_ = total - starts_[tile_count];
  return kept_length;
}

void TileLists::build_by_keys(std::span<const Splat> splats, std::span<const DepthSlot> visible,
                              glm::ivec2 grid, std::uint64_t max_entries, ThreadPool& pool) {
  const auto tile_count = static_cast<std::size_t>(grid.x) * static_cast<std::size_t>(grid.y);
  const auto tiles_touched = [&](const DepthSlot& v) {
    const Splat& s = splats[v.value];
    return static_cast<std::uint64_t>(s.tile_end_x - s.tile_x) *
           static_cast<std::uint64_t>(s.tile_end_y - s.tile_y);
  };
  // Each splat's first key, so that splats can write theirs independently of each other.
  key_offsets_.resize(visible.size());
  std::transform_exclusive_scan(visible.begin(), visible.end(), key_offsets_.begin(),
                                std::uint64_t{0}, std::plus<>(), tiles_touched);
  const std::uint64_t wanted =
      visible.empty() ? 0 : key_offsets_.back() + tiles_touched(visible.back());
  const std::uint64_t total = std::min(wanted, max_entries);
  overflowed_ = wanted - total;
  keys_.resize(total);
  key_scratch_.resize(total);

  constexpr std::size_t run = 1024;  // splats a call takes
  pool.parallel_for((visible.size() + run - 1) / run, [&](std::size_t task) {
    for (std::size_t i = task * run; i < std::min(visible.size(), (task + 1) * run); ++i) {
      const Splat& s = splats[visible[i].value];
      std::uint64_t at = key_offsets_[i];
      for (int y = s.tile_y; y < s.tile_end_y; ++y)
        for (int x = s.tile_x; x < s.tile_end_x && at < total; ++x, ++at)
          keys_[at] = {static_cast<std::uint64_t>(y * grid.x + x) << 32 | visible[i].key,
                       visible[i].value};
    }
  });
  sorter_.sort(keys_, key_scratch_, 32 + static_cast<int>(std::bit_width(tile_count - 1)), pool);
  order_ties(splats, std::span(keys_));

  starts_.assign(tile_count + 1, 0);
  if (entries_.size() < total) entries_.resize(total);
  for (std::size_t i = 0; i < total; ++i) {
    entries_[i] = keys_[i].value;
    ++starts_[(keys_[i].key >> 32) + 1];
  }
  std::partial_sum(starts_.begin(), starts_.end(), starts_.begin());
}

std::uint32_t TileLists::longest() const {
  std::uint64_t length = 0;
  for (std::size_t tile = 0; tile < tiles(); ++tile)
    length = std::max(length, starts_[tile + 1] - starts_[tile]);
  return static_cast<std::uint32_t>(length);
}

}  // namespace catgs

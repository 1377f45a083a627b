#if defined(CATGS_CPU_BIN_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef CATGS_CPU_BIN_INL_H
#undef CATGS_CPU_BIN_INL_H
#else
#define CATGS_CPU_BIN_INL_H
#endif

#include <bit>
#include <span>
#include <vector>

#include "render_core/cpu/kernels.h"
#include "render_core/cpu/lanes-inl.h"
#include "render_core/math/ellipse-inl.h"
#include "render_core/math/trail-inl.h"

HWY_BEFORE_NAMESPACE();
namespace catgs {
namespace HWY_NAMESPACE {

/// Tile rows tested at once. Few, because most splats touch two or three.
using RowLanes = Lanes<hn::CappedTag<float, 4>>;

/// Appends the tiles `from`…`to` of a row, without those at its ends where the splat is hidden.
HWY_INLINE void add_run(const Splat& s, std::uint32_t slot, int row, int from, int to,
                        const DepthLimits& limits, TileRun*& runs) {
  if (limits) {
    while (from < to && s.depth > limits.of_tile(from, row)) ++from;
    while (from < to && s.depth > limits.of_tile(to - 1, row)) --to;
    if (from == to) return;
  }
  *runs++ = {static_cast<std::uint16_t>(row),
             static_cast<std::uint16_t>(from),
             static_cast<std::uint16_t>(to),
             {std::bit_cast<std::uint32_t>(s.depth), slot}};
}

/// Appends to `runs` the tiles that a splat's ellipse or trail meets in RowLanes::count rows of
/// tiles from `row` on, without tiles at the ends of a row where it is hidden; returns the new end.
template <class Shape>
HWY_INLINE TileRun* list_rows(const Splat& s, const Shape& shape, int row, std::uint32_t slot,
                              const DepthLimits& limits, TileRun* runs) {
  using L = RowLanes;
  constexpr auto side = static_cast<float>(tile_size_px);
  const L low_y = mul_add(L::iota(static_cast<float>(row)), L(side), L(0.5f - s.centre_y));
  const Interval<L> columns = columns_in_band(convert<L>(shape), low_y, low_y + L(side - 1.0f));
  constexpr auto slack = static_cast<float>(listing_slack_px);
  // Pixel columns whose centres are inside, then tiles. Both are limited to the splat's box of
  // tiles.
  const L first =
      max(ceil(columns.low + L(s.centre_x - 0.5f - slack)), L(static_cast<float>(s.tile_x) * side));
  const L last = min(floor(columns.high + L(s.centre_x - 0.5f + slack)),
                     L(static_cast<float>(s.tile_end_x) * side - 1.0f));
  const auto hit = (columns.low <= columns.high) & (first <= last);
  alignas(16) float begin[L::count], end[L::count];
  (first * L(1.0 / tile_size_px)).store(begin);
  (last * L(1.0 / tile_size_px)).store(end);

  const int rows_left = s.tile_end_y - row;
  std::uint32_t hits = bits(hit);
  if (rows_left < static_cast<int>(L::count)) hits &= (1u << rows_left) - 1u;
  for (; hits != 0; hits &= hits - 1) {
    const int lane = std::countr_zero(hits);
    add_run(s, slot, row + lane, static_cast<int>(begin[lane]), static_cast<int>(end[lane]) + 1,
            limits, runs);
  }
  return runs;
}

/// The ellipse of a Splat or a SplatPath.
template <class S>
HWY_INLINE Ellipse<float> ellipse_of(const S& s) {
  return make_ellipse<float>({s.whitening_xx, s.whitening_xy, s.whitening_yy},
                             reach_of(s.log2_opacity), s.half_extent_x, s.rightmost_y);
}

inline void list_tiles(const ListTask& task, std::vector<TileRun>& runs) {
  std::size_t most = 0;
  for (const Splat& s : task.splats) most += s.tile_end_y - s.tile_y;
  const std::size_t known = runs.size();
  runs.resize(known + most);
  TileRun* end = runs.data() + known;
  std::uint32_t slot = task.first_slot;
  const auto list = [&](const Splat& s, const auto& shape) HWY_ATTR {
    for (int row = s.tile_y; row < s.tile_end_y; row += static_cast<int>(RowLanes::count))
      end = list_rows(s, shape, row, slot, task.limits, end);
  };
  for (std::size_t i = 0; i < task.splats.size(); ++i, ++slot) {
    const Splat& s = task.splats[i];
    // A shape in one row of tiles, or in one column, meets nearly all tiles of its box.
    if (s.tile_end_x - s.tile_x == 1 || s.tile_end_y - s.tile_y == 1) {
      for (std::uint16_t row = s.tile_y; row < s.tile_end_y; ++row)
        add_run(s, slot, row, s.tile_x, s.tile_end_x, task.limits, end);
      continue;
    }
    if (task.paths == nullptr) {
      list(s, ellipse_of(s));
    } else {
      const SplatPath& path = task.paths[i];
      list(s, make_trail(ellipse_of(path), {path.dx, path.dy}));
    }
  }
  runs.resize(static_cast<std::size_t>(end - runs.data()));
}

}  // namespace HWY_NAMESPACE
}  // namespace catgs
HWY_AFTER_NAMESPACE();

#endif

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

HWY_BEFORE_NAMESPACE();
namespace catgs {
namespace HWY_NAMESPACE {

/// Appends the runs of tiles that the ellipse of a splat meets, for Floats::count rows of tiles
/// from `row` on at once.
HWY_INLINE void list_rows(const Splat& s, const Ellipse<Floats>& ellipse, int row,
                          std::uint32_t slot, std::vector<TileRun>& runs) {
  constexpr auto side = static_cast<float>(tile_size_px);
  const Floats low_y =
      mul_add(Floats::iota(static_cast<float>(row)), Floats(side), Floats(0.5f - s.centre_y));
  const Interval<Floats> columns = columns_in_band(ellipse, low_y, low_y + Floats(side - 1.0f));
  // Pixel columns with centres inside, then tiles, both inside the splat's box of tiles.
  const Floats slack = Floats(listing_slack_px);
  const Floats offset = Floats(s.centre_x - 0.5f);
  const Floats leftmost = Floats(static_cast<float>(s.tile_x) * side);
  const Floats rightmost = Floats(static_cast<float>(s.tile_end_x) * side - 1.0f);
  const Floats first = max(ceil(offset + columns.low - slack), leftmost);
  const Floats last = min(floor(offset + columns.high + slack), rightmost);
  const auto hit = (columns.low <= columns.high) & (first <= last);
  const Floats per_px = Floats(1.0 / tile_size_px);
  alignas(64) float begin[Floats::count], end[Floats::count];
  (first * per_px).store(begin);
  (last * per_px).store(end);

  const int rows_left = s.tile_end_y - row;
  std::uint32_t hits = bits(hit);
  if (rows_left < static_cast<int>(Floats::count)) hits &= (1u << rows_left) - 1u;
  for (; hits != 0; hits &= hits - 1) {
    const int lane = std::countr_zero(hits);
    runs.push_back({static_cast<std::uint16_t>(row + lane),
                    static_cast<std::uint16_t>(static_cast<int>(begin[lane])),
                    static_cast<std::uint16_t>(static_cast<int>(end[lane]) + 1),
                    {std::bit_cast<std::uint32_t>(s.depth), slot}});
  }
}

inline void list_tiles(std::span<const Splat> splats, std::uint32_t first_slot,
                       std::vector<TileRun>& runs) {
  std::uint32_t slot = first_slot;
  for (const Splat& s : splats) {
    if (s.tile_end_x - s.tile_x == 1 && s.tile_end_y - s.tile_y == 1) {
      runs.push_back(
          {s.tile_y, s.tile_x, s.tile_end_x, {std::bit_cast<std::uint32_t>(s.depth), slot}});
    } else {
      const Whitening<Floats> w{Floats(s.whitening_xx), Floats(s.whitening_xy),
                                Floats(s.whitening_yy)};
      const Ellipse<Floats> ellipse =
          make_ellipse(w, reach_of(Floats(s.log2_opacity)), Floats(s.half_extent_x));
      for (int row = s.tile_y; row < s.tile_end_y; row += static_cast<int>(Floats::count))
        list_rows(s, ellipse, row, slot, runs);
    }
    ++slot;
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace catgs
HWY_AFTER_NAMESPACE();

#endif

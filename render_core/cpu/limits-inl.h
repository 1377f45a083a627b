#if defined(CATGS_CPU_LIMITS_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef CATGS_CPU_LIMITS_INL_H
#undef CATGS_CPU_LIMITS_INL_H
#else
#define CATGS_CPU_LIMITS_INL_H
#endif

#include <algorithm>
#include <cmath>

#include "render_core/cpu/kernels.h"
#include "render_core/cpu/lanes-inl.h"
#include "render_core/math/occlusion-inl.h"

HWY_BEFORE_NAMESPACE();
namespace catgs {
namespace HWY_NAMESPACE {

using IntTag = hn::RebindToSigned<hn::ScalableTag<float>>;
using Ints = hn::Vec<IntTag>;

HWY_INLINE Ints to_ints(const Floats& v) { return hn::ConvertTo(IntTag(), v.v); }

HWY_INLINE Floats gather(const float* base, const Ints& index) {
  return Floats(hn::GatherIndex(hn::ScalableTag<float>(), base, index));
}

inline void find_limits(const LimitTask& task) {
  const auto now = convert<Floats>(make_camera_model(*task.now));
  const auto last = convert<Floats>(make_camera_model(*task.last));
  const Floats zero(0.0), per_px(1.0 / part_side_px), unknown(INFINITY);
  const Floats columns(static_cast<float>(task.parts.x)), rows(static_cast<float>(task.parts.y));
  const Floats stride(static_cast<float>(task.stride));
  const auto deepest_end = [&](const Floats& x_px, const Floats& y_px) HWY_ATTR {
    const Floats x = floor(x_px * per_px), y = floor(y_px * per_px);
    const auto inside = (x >= zero) & (y >= zero) & (x < columns) & (y < rows);
    const Floats position = select(inside, mul_add(y, stride, x), zero);
    return select(inside, gather(task.deepest, to_ints(position)), unknown);
  };
  const Floats middle_y((static_cast<float>(task.row) + 0.5f) * part_side_px);
  for (int x = 0; x < task.parts.x; x += static_cast<int>(Floats::count)) {
    const Floats middle_x = (Floats::iota(static_cast<float>(x)) + Floats(0.5)) *
                            Floats(static_cast<float>(part_side_px));
    const Floats limit = occlusion_limit<Floats>(now, last, {middle_x, middle_y}, deepest_end);
    alignas(64) float row[Floats::count];
    limit.store(row);
    std::copy_n(row, std::min(static_cast<int>(Floats::count), task.parts.x - x), task.limits + x);
  }
}

/// The deepest limit in a box of the picture, px. The level is the finest with at most 3x3 cells in
/// the box.
HWY_INLINE Floats deepest_limit(const DepthLimits& limits, const Floats& left, const Floats& top,
                                const Floats& right, const Floats& bottom) {
  const IntTag d;
  const Floats per_px(1.0 / part_side_px), half(0.5);
  const Floats x0 = floor(left * per_px), x2 = floor(right * per_px);
  const Floats y0 = floor(top * per_px), y2 = floor(bottom * per_px);
  const Floats span = max(max(x2 - x0, y2 - y0) * half, Floats(1.0));
  // ceil(log2(span)) is the exponent of the largest float below 2 span.
  const Ints exponent = hn::Sub(hn::BitCast(d, (span + span).v), hn::Set(d, 1));
  const Ints level = hn::Sub(hn::ShiftRight<23>(exponent), hn::Set(d, 127));
  const auto cell = [&](const Floats& v) HWY_ATTR { return hn::Shr(to_ints(v), level); };
  const Ints one = hn::Set(d, 1), zero = hn::Zero(d);
  const Ints left_cell = cell(x0), last_column = cell(x2);
  const Ints top_cell = cell(y0), last_row = cell(y2);
  // Where a box has several columns or rows, each load is of two.
  const Ints right_cell = hn::Max(left_cell, hn::Sub(last_column, one));
  const Ints low_cell = hn::Max(top_cell, hn::Sub(last_row, one));
  const auto spread_where =
      [&](const Ints& last, const Ints& first, DepthLimits::Spread spread)
          HWY_ATTR { return hn::IfThenElse(hn::Gt(last, first), hn::Set(d, spread), zero); };
  const Ints spread = hn::Or(spread_where(last_column, left_cell, DepthLimits::right),
                             spread_where(last_row, top_cell, DepthLimits::below));
  const Ints pyramid =
      hn::Mul(hn::Add(hn::Mul(spread, hn::Set(d, limits.levels)), level), hn::Set(d, limits.rows));
  const auto at = [&](const Ints& column, const Ints& row) HWY_ATTR {
    const Ints rows = hn::Mul(hn::Add(pyramid, row), hn::Set(d, limits.columns));
    return gather(limits.cells, hn::Add(rows, column));
  };
  return max(max(at(left_cell, top_cell), at(right_cell, top_cell)),
             max(at(left_cell, low_cell), at(right_cell, low_cell)));
}

}  // namespace HWY_NAMESPACE
}  // namespace catgs
HWY_AFTER_NAMESPACE();

#endif

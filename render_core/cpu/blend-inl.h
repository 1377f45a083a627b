#if defined(CATGS_CPU_BLEND_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef CATGS_CPU_BLEND_INL_H
#undef CATGS_CPU_BLEND_INL_H
#else
#define CATGS_CPU_BLEND_INL_H
#endif

#include <algorithm>
#include <bit>

#include <hwy/cache_control.h>

#include "render_core/cpu/pixels-inl.h"
#include "render_core/math/ellipse-inl.h"

HWY_BEFORE_NAMESPACE();
namespace catgs {
namespace HWY_NAMESPACE {

/// Splats that are blended together, a bit of a word each. Each block takes those that meet it,
/// while its pixels stay in registers.
inline constexpr std::size_t batch_size = 64;

/// Splats as culling reads them: an array for each field.
struct Batch {
  // Whitened coordinates of the origin and their growth per pixel; see Whitening. Aligned, because
  // whole registers are stored.
  alignas(64) float u[batch_size];
  alignas(64) float v[batch_size];
  alignas(64) float xx[batch_size];
  alignas(64) float xy[batch_size];
  alignas(64) float yy[batch_size];
  alignas(64) float reach[batch_size];
  const Splat* splats[batch_size];
  std::size_t count = 0;
};

/// Fills the batch from the front of `list`. `origin`: of the batch's coordinates, px.
HWY_INLINE void load(const BlendTask& task, std::span<const DepthSlot> list, Vec2<float> origin,
                     Batch& batch) {
  const hn::ScalableTag<float> d;
  alignas(64) float fields[2][4 * batch_size];
  batch.count = std::min(list.size(), batch_size);
  for (std::size_t i = 0; i < batch.count; ++i) {
    if (i + batch_size < list.size())  // splats are scattered in memory
      hwy::Prefetch(&task.splats[list[i + batch_size].value]);
    const Splat& s = task.splats[list[i].value];
    batch.splats[i] = &s;
    std::memcpy(fields[0] + 4 * i, &s.centre_x, 4 * sizeof(float));
    std::memcpy(fields[1] + 4 * i, &s.whitening_yy, 4 * sizeof(float));
  }
  for (std::size_t i = 0; i < batch.count; i += Floats::count) {
    Floats x, y, xx, xy, yy, log2_opacity, unused_x, unused_y;
    hn::LoadInterleaved4(d, fields[0] + 4 * i, x.v, y.v, xx.v, xy.v);
    hn::LoadInterleaved4(d, fields[1] + 4 * i, yy.v, log2_opacity.v, unused_x.v, unused_y.v);
    const Floats dx = Floats(origin.x) - x, dy = Floats(origin.y) - y;
    mul_add(xx, dx, xy * dy).store(batch.u + i);
    (yy * dy).store(batch.v + i);
    xx.store(batch.xx + i);
    xy.store(batch.xy + i);
    yy.store(batch.yy + i);
    (reach_of(log2_opacity) + Floats(1e-4)).store(batch.reach + i);  // more than the rounding error
  }
}

/// The splats of a batch that meet a block.
struct Hits {
  // Whitened coordinates of the block's first pixel.
  alignas(64) float u[batch_size];
  alignas(64) float v[batch_size];
  std::uint64_t splats = 0;  // one bit each
};

/// Finds splats whose ellipse alpha >= alpha_min may meet the block at `offset` from the batch's
/// origin: those whose bands around both whitened axes meet it. Without `cull`: all.
template <bool cull>
HWY_INLINE void find_hits(const Batch& batch, Vec2<float> offset, Hits& hits) {
  const Floats zero(0.0), last(static_cast<float>(block_side_px - 1));
  const Floats x(offset.x), y(offset.y);
  hits.splats = 0;
  for (std::size_t i = 0; i < batch.count; i += Floats::count) {
    const Floats xx = Floats::load(batch.xx + i), xy = Floats::load(batch.xy + i);
    const Floats yy = Floats::load(batch.yy + i);
    const Floats u = mul_add(xx, x, mul_add(xy, y, Floats::load(batch.u + i)));
    const Floats v = mul_add(yy, y, Floats::load(batch.v + i));
    u.store(hits.u + i);
    v.store(hits.v + i);
    if constexpr (!cull) continue;
    const Floats down = xy * last;
    const Floats low_u = u + min(down, zero), high_u = mul_add(xx, last, u + max(down, zero));
    const Floats high_v = mul_add(yy, last, v);
    const Floats nearest_u = max(max(low_u, -high_u), zero);
    const Floats nearest_v = max(max(v, -high_v), zero);
    const auto met =
        mul_add(nearest_u, nearest_u, nearest_v * nearest_v) <= Floats::load(batch.reach + i);
    hits.splats |= static_cast<std::uint64_t>(bits(met)) << i;
  }
  const std::uint64_t all = ~std::uint64_t{0} >> (batch_size - batch.count);
  hits.splats = cull ? hits.splats & all : all;
}

/// Blends the hits over a block. Returns the number of pairs if `count_pairs`. `finished` tells
/// whether all pixels are finished.
template <bool count_pairs>
HWY_INLINE std::uint64_t blend_hits(const Batch& batch, const Hits& hits, BlockPixels& pixels,
                                    bool& finished) {
  constexpr int registers = block_px / lanes;
  RunningPixel<Floats> pixel[registers];
  for (int k = 0; k < registers; ++k) pixel[k] = begin_run(pixels.load(k * lanes));
  std::uint64_t pairs = 0;
  finished = false;
  for (std::uint64_t left = hits.splats; left != 0 && !finished; left &= left - 1) {
    const int i = std::countr_zero(left);
    const Splat& s = *batch.splats[i];
    const Floats start_u(hits.u[i]), start_v(hits.v[i]), log2_opacity(s.log2_opacity);
    const Floats xx(s.whitening_xx), xy(s.whitening_xy), yy(s.whitening_yy);
    const Vec3<Floats> colour{Floats(s.red), Floats(s.green), Floats(s.blue)};
    finished = true;
    for (int k = 0; k < registers; ++k) {
      const Floats x = Floats::load(columns_in_block + k * lanes);
      const Floats y = Floats::load(rows_in_block + k * lanes);
      const Floats u = mul_add(xx, x, mul_add(xy, y, start_u)), v = mul_add(yy, y, start_v);
      const Floats exponent = neg_mul_add(u, u, neg_mul_add(v, v, log2_opacity));
      const auto live = blend(pixel[k], exponent, colour);
      finished &= none(live);
      if constexpr (count_pairs) pairs += std::popcount(bits(live & contributes(exponent)));
    }
  }
  for (int k = 0; k < registers; ++k) pixels.store(k * lanes, end_run(pixel[k]));
  return pairs;
}

template <bool cull, bool count_pairs>
BlendResult blend_list(const BlendTask& task, BlockPixels* pixels) {
  const PixelBlock origin = task.blocks[0];
  const Vec2<float> first{static_cast<float>(origin.x) + 0.5f, static_cast<float>(origin.y) + 0.5f};
  std::uint32_t live_blocks =
      static_cast<std::uint32_t>((std::uint64_t{1} << task.blocks.size()) - 1);
  BlendResult result;
  Batch batch;
  Hits hits;
  while (result.looked_at < task.list.size() && live_blocks != 0) {
    load(task, task.list.subspan(result.looked_at), first, batch);
    result.looked_at += batch.count;
    for (std::uint32_t left = live_blocks; left != 0; left &= left - 1) {
      const int block = std::countr_zero(left);
      find_hits<cull>(batch,
                      {static_cast<float>(task.blocks[block].x - origin.x),
                       static_cast<float>(task.blocks[block].y - origin.y)},
                      hits);
      bool finished = false;
      result.pairs += blend_hits<count_pairs>(batch, hits, pixels[block], finished);
      if (finished) live_blocks &= ~(1u << block);
    }
  }
  result.finished = live_blocks == 0;
  return result;
}

inline BlendResult blend_blocks(const BlendTask& task) {
  BlockPixels pixels[max_task_blocks];
  for (std::size_t i = 0; i < task.blocks.size(); ++i)
    clear(pixels[i], task.blocks[i], task.image->size_px());
  BlendResult result;
  if (task.count_pairs) {
    result = task.cull_blocks ? blend_list<true, true>(task, pixels)
                              : blend_list<false, true>(task, pixels);
  } else {
    result = task.cull_blocks ? blend_list<true, false>(task, pixels)
                              : blend_list<false, false>(task, pixels);
  }
  for (std::size_t i = 0; i < task.blocks.size(); ++i) {
    resolve_block(pixels[i], task.background);
    if (task.image->format() == PixelFormat::rgb_f32) {
      write_rgb(pixels[i], task.blocks[i], *task.image);
    } else {
      write_i420(pixels[i], task.blocks[i], *task.image);
    }
  }
  return result;
}

}  // namespace HWY_NAMESPACE
}  // namespace catgs
HWY_AFTER_NAMESPACE();

#endif

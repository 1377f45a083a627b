#if defined(CATGS_CPU_BLEND_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef CATGS_CPU_BLEND_INL_H
#undef CATGS_CPU_BLEND_INL_H
#else
#define CATGS_CPU_BLEND_INL_H
#endif

#include <algorithm>
#include <bit>
#include <limits>
#include <type_traits>

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

/// What a blend notes beside the colours.
enum class Notes { nothing, depths, depths_and_pairs };

/// A block's pixels in registers, for as long as a batch is blended.
template <bool fills, bool depths>
struct BlockRun {
  static constexpr int registers = block_px / lanes;
  std::conditional_t<fills, PixelState<Floats>, RunningPixel<Floats>> pixel[registers];
  Floats half_depth[depths ? registers : 1];

  HWY_INLINE explicit BlockRun(const BlockPixels& pixels) {
    for (int k = 0; k < registers; ++k) {
      if constexpr (fills) {
        pixel[k] = pixels.load(k * lanes);
      } else {
        pixel[k] = begin_run(pixels.load(k * lanes));
      }
      if constexpr (depths) half_depth[k] = Floats::load(pixels.half_depth + k * lanes);
    }
  }
  /// Light comes to a splat at this depth. Where more than half of it is left, the splat may be the
  /// one that stops half.
  HWY_INLINE void reach(int k, const Floats& depth) {
    const Floats half(0.5);
    if constexpr (fills) {
      half_depth[k] = select(pixel[k].transmittance >= half, depth, half_depth[k]);
    } else {
      half_depth[k] = select(pixel[k].running >= half, depth, half_depth[k]);
    }
  }
  /// Returns which pixels of a register are not finished.
  HWY_INLINE FloatMask add(int k, const Floats& exponent, const Vec3<Floats>& colour) {
    if constexpr (fills) {
      return blend_on(pixel[k], exponent, colour);
    } else {
      return blend(pixel[k], exponent, colour);
    }
  }
  HWY_INLINE void store(BlockPixels& pixels) const {
    for (int k = 0; k < registers; ++k) {
      if constexpr (fills) {
        pixels.store(k * lanes, pixel[k]);
      } else {
        pixels.store(k * lanes, end_run(pixel[k]));
      }
      if constexpr (depths) half_depth[k].store(pixels.half_depth + k * lanes);
    }
  }
};

/// Blends the hits over a block until all its pixels are finished. Returns the splat that finished
/// them, or null. Adds the pairs to `pairs` if they are counted.
template <bool fills, Notes notes>
HWY_INLINE const Splat* blend_hits(const Batch& batch, const Hits& hits, BlockPixels& pixels,
                                   std::uint64_t& pairs) {
  constexpr bool depths = notes != Notes::nothing;
  BlockRun<fills, depths> run(pixels);
  const Splat* last = nullptr;
  for (std::uint64_t left = hits.splats; left != 0 && last == nullptr; left &= left - 1) {
    const int i = std::countr_zero(left);
    const Splat& s = *batch.splats[i];
    const Floats start_u(hits.u[i]), start_v(hits.v[i]), log2_opacity(s.log2_opacity);
    const Floats xx(s.whitening_xx), xy(s.whitening_xy), yy(s.whitening_yy);
    const Vec3<Floats> colour{Floats(s.red), Floats(s.green), Floats(s.blue)};
    bool finished = true;
    for (int k = 0; k < block_px / lanes; ++k) {
      const Floats x = Floats::load(columns_in_block + k * lanes);
      const Floats y = Floats::load(rows_in_block + k * lanes);
      const Floats u = mul_add(xx, x, mul_add(xy, y, start_u)), v = mul_add(yy, y, start_v);
      const Floats exponent = neg_mul_add(u, u, neg_mul_add(v, v, log2_opacity));
      if constexpr (depths) run.reach(k, Floats(s.depth));
      const FloatMask live = run.add(k, exponent, colour);
      finished &= none(live);
      if constexpr (notes == Notes::depths_and_pairs)
        pairs += std::popcount(bits(live & contributes(exponent)));
    }
    if (finished) last = &s;
  }
  run.store(pixels);
  return last;
}

/// First pixel of block `b` in its tile, row by row.
constexpr glm::ivec2 block_corner_px(int b) {
  return block_side_px * glm::ivec2(b % parts_across, b / parts_across);
}
static_assert(part_side_px == block_side_px, "a part is a block");

/// The pixels of a tile.
struct TilePixels {
  BlockPixels blocks[blocks_per_tile];
  float ends[blocks_per_tile];  // depth of the splat that finished a block; infinity: none did
  std::uint32_t inside;         // blocks that meet the image, a bit each
};

/// Blends the list over the blocks inside the image. Returns the pairs if they are counted.
template <bool cull, bool fills, Notes notes>
std::uint64_t blend_list(const BlendTask& task, TilePixels& pixels) {
  const Vec2<float> first{static_cast<float>(task.first_px.x) + 0.5f,
                          static_cast<float>(task.first_px.y) + 0.5f};
  std::uint32_t live_blocks = pixels.inside;
  std::uint64_t pairs = 0;
  Batch batch;
  Hits hits;
  for (std::size_t at = 0; at < task.list.size() && live_blocks != 0; at += batch.count) {
    load(task, task.list.subspan(at), first, batch);
    for (std::uint32_t left = live_blocks; left != 0; left &= left - 1) {
      const int block = std::countr_zero(left);
      const glm::ivec2 corner = block_corner_px(block);
      find_hits<cull>(batch, {static_cast<float>(corner.x), static_cast<float>(corner.y)}, hits);
      const Splat* last = blend_hits<fills, notes>(batch, hits, pixels.blocks[block], pairs);
      if (last == nullptr) continue;
      pixels.ends[block] = last->depth;
      live_blocks &= ~(1u << block);
    }
  }
  return pairs;
}

inline void note_ends(const TilePixels& pixels, const PartEnds& ends) {
  for (std::uint32_t left = pixels.inside; left != 0; left &= left - 1) {
    const int b = std::countr_zero(left);
    ends.first[b / parts_across * ends.stride + b % parts_across] = pixels.ends[b];
  }
}

inline void note_depths(const TilePixels& pixels, const PartEnds& depths) {
  for (std::uint32_t left = pixels.inside; left != 0; left &= left - 1) {
    const int b = std::countr_zero(left);
    depths.first[b / parts_across * depths.stride + b % parts_across] =
        shown_inverse_depth(pixels.blocks[b]);
  }
}

template <bool cull, bool fills>
std::uint64_t blend_list(const BlendTask& task, TilePixels& pixels) {
  if (task.count_pairs) return blend_list<cull, fills, Notes::depths_and_pairs>(task, pixels);
  return task.depths.first != nullptr ? blend_list<cull, fills, Notes::depths>(task, pixels)
                                      : blend_list<cull, fills, Notes::nothing>(task, pixels);
}

inline std::uint64_t blend_tile(const BlendTask& task) {
  TilePixels pixels;
  const glm::ivec2 size_px = task.image->size_px();
  pixels.inside = 0;
  for (int b = 0; b < blocks_per_tile; ++b) {
    const glm::ivec2 first = task.first_px + block_corner_px(b);
    pixels.ends[b] = std::numeric_limits<float>::infinity();
    if (first.x >= size_px.x || first.y >= size_px.y) continue;
    pixels.inside |= 1u << b;
    clear(pixels.blocks[b], size_px - first);
  }
  std::uint64_t pairs = 0;
  if (task.fills) {
    pairs = blend_list<true, true>(task, pixels);
  } else if (task.cull_blocks) {
    pairs = blend_list<true, false>(task, pixels);
  } else {
    pairs = blend_list<false, false>(task, pixels);
  }
  if (task.depths.first != nullptr) note_depths(pixels, task.depths);
  for (std::uint32_t left = pixels.inside; left != 0; left &= left - 1) {
    const int b = std::countr_zero(left);
    const glm::ivec2 first = task.first_px + block_corner_px(b);
    resolve_block(pixels.blocks[b], task.background, task.fills);
    if (task.image->format() == PixelFormat::rgb_f32) {
      write_rgb(pixels.blocks[b], first, *task.image);
    } else {
      write_i420(pixels.blocks[b], first, *task.image);
    }
  }
  if (task.ends.first != nullptr) note_ends(pixels, task.ends);
  return pairs;
}

}  // namespace HWY_NAMESPACE
}  // namespace catgs
HWY_AFTER_NAMESPACE();

#endif

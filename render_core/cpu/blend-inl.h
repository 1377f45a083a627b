#if defined(CATGS_CPU_BLEND_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef CATGS_CPU_BLEND_INL_H
#undef CATGS_CPU_BLEND_INL_H
#else
#define CATGS_CPU_BLEND_INL_H
#endif

#include <algorithm>
#include <bit>
#include <cstring>

#include <hwy/cache_control.h>

#include "render_core/cpu/kernels.h"
#include "render_core/cpu/lanes-inl.h"
#include "render_core/math/blend-inl.h"
#include "render_core/math/colour-inl.h"
#include "render_core/math/ellipse-inl.h"

HWY_BEFORE_NAMESPACE();
namespace catgs {
namespace HWY_NAMESPACE {

inline constexpr int tile_px = tile_size_px;
inline constexpr int lanes = static_cast<int>(Floats::count);

/// A block is the part of a row that is culled as one: a register where that is wide enough. Block
/// y + 16 k of a tile holds columns k block_px… of row y.
inline constexpr int block_px = lanes == 1 ? tile_px : std::max(lanes, 8);
inline constexpr int blocks_per_row = tile_px / block_px;
static_assert(blocks_per_row <= 2, "a tile's blocks fit the bits of a word");

/// The pixels of a tile while they are blended; rows of 16.
struct alignas(64) TileState {
  float red[tile_px * tile_px];
  float green[tile_px * tile_px];
  float blue[tile_px * tile_px];
  float transmittance[tile_px * tile_px];  // as in PixelState
  std::uint32_t live_blocks = 0;           // bit per block: it has unfinished pixels

  HWY_INLINE PixelState<Floats> load(int at) const {
    return {{Floats::load(red + at), Floats::load(green + at), Floats::load(blue + at)},
            Floats::load(transmittance + at)};
  }
  HWY_INLINE void store(int at, const PixelState<Floats>& pixel) {
    pixel.colour.x.store(red + at);
    pixel.colour.y.store(green + at);
    pixel.colour.z.store(blue + at);
    pixel.transmittance.store(transmittance + at);
  }
};

/// Empty pixels; those outside the image are finished from the start. `size_px`: the part of the
/// tile inside the image.
inline void clear(TileState& state, glm::ivec2 size_px) {
  for (int y = 0; y < tile_px; ++y) {
    for (int x = 0; x < tile_px; x += lanes) {
      PixelState<Floats> pixel = empty_pixel<Floats>();
      const Floats column = Floats::iota(static_cast<float>(x));
      const auto inside = column < Floats(static_cast<float>(y < size_px.y ? size_px.x : 0));
      pixel.transmittance = select(inside, pixel.transmittance, -pixel.transmittance);
      state.store(y * tile_px + x, pixel);
    }
    for (int k = 0; k < blocks_per_row; ++k)
      if (y < size_px.y && k * block_px < size_px.x) state.live_blocks |= 1u << (y + k * tile_px);
  }
}

/// A splat's exponent along the rows of a tile: at column x of row y it is
/// exponent[y] - (start[y] + whitening_xx x)^2.
struct alignas(64) RowTerms {
  float start[tile_px];
  float exponent[tile_px];
};

/// Fills the terms; returns the blocks whose line of pixel centres meets the ellipse alpha >=
/// alpha_min. `first` is the tile's first pixel centre.
HWY_INLINE std::uint32_t row_terms(const Splat& s, Vec2<float> first, RowTerms& terms) {
  const Floats xx(s.whitening_xx), xy(s.whitening_xy), yy(s.whitening_yy);
  const Floats left_x(s.whitening_xx * (first.x - s.centre_x));
  const Floats width = xx * Floats(static_cast<float>(block_px - 1));
  const Floats block = xx * Floats(static_cast<float>(block_px));
  std::uint32_t blocks = 0;
  for (int y = 0; y < tile_px; y += lanes) {
    const Floats dy = Floats::iota(static_cast<float>(y)) + Floats(first.y - s.centre_y);
    const Floats v = yy * dy;
    const Floats exponent = Floats(s.log2_opacity) - v * v;
    Floats start = mul_add(xy, dy, left_x);
    start.store(terms.start + y);
    exponent.store(terms.exponent + y);
    const Floats reach = reach_of(exponent) + Floats(1e-4);  // wider than rounding errs below
    for (int k = 0; k < blocks_per_row; ++k, start = start + block) {
      const Floats nearest = max(max(start, -(start + width)), Floats(0.0));
      blocks |= bits(nearest * nearest <= reach) << (y + k * tile_px);
    }
  }
  return blocks;
}

/// Blends one block; returns the number of pairs when asked to.
template <bool count_pairs>
HWY_INLINE std::uint32_t blend_block(TileState& state, int block, const Splat& s,
                                     const RowTerms& terms, const Vec3<Floats>& colour) {
  alignas(64) static constexpr float columns[tile_px] = {0, 1, 2,  3,  4,  5,  6,  7,
                                                         8, 9, 10, 11, 12, 13, 14, 15};
  const int y = block % tile_px;
  const Floats start(terms.start[y]), row_exponent(terms.exponent[y]), xx(s.whitening_xx);
  std::uint32_t pairs = 0;
  bool finished = true;
  for (int x = 0; x < block_px; x += lanes) {
    const int column = block / tile_px * block_px + x;
    const Floats u = mul_add(xx, Floats::load(columns + column), start);
    const Floats exponent = row_exponent - u * u;
    PixelState<Floats> pixel = state.load(y * tile_px + column);
    const auto live = blend(pixel, exponent, colour);
    state.store(y * tile_px + column, pixel);
    finished &= none(live);
    if constexpr (count_pairs) pairs += std::popcount(bits(live & contributes(exponent)));
  }
  if (finished) state.live_blocks &= ~(1u << block);
  return pairs;
}

template <bool cull_blocks, bool count_pairs>
std::uint64_t blend_list(TileState& state, const BlendTask& task) {
  const Vec2<float> first{static_cast<float>(task.tile.x * tile_px) + 0.5f,
                          static_cast<float>(task.tile.y * tile_px) + 0.5f};
  constexpr std::size_t prefetch_distance = 8;  // list entries; splats lie scattered
  std::uint64_t pairs = 0;
  RowTerms terms;
  for (std::size_t i = 0; i < task.list.size() && state.live_blocks != 0; ++i) {
    if (i + prefetch_distance < task.list.size())
      hwy::Prefetch(&task.splats[task.list[i + prefetch_distance].value]);
    const Splat& s = task.splats[task.list[i].value];
    const std::uint32_t met = row_terms(s, first, terms);
    const Vec3<Floats> colour{Floats(s.red), Floats(s.green), Floats(s.blue)};
    for (std::uint32_t blocks = state.live_blocks & (cull_blocks ? met : ~0u); blocks != 0;
         blocks &= blocks - 1)
      pairs += blend_block<count_pairs>(state, std::countr_zero(blocks), s, terms, colour);
  }
  return pairs;
}

/// Resolves the tile over the background in place.
inline void resolve_tile(TileState& state, const glm::vec3& background) {
  const Vec3<Floats> behind{Floats(background.x), Floats(background.y), Floats(background.z)};
  for (int at = 0; at < tile_px * tile_px; at += lanes) {
    PixelState<Floats> pixel = state.load(at);
    pixel.colour = resolve(pixel, behind);
    state.store(at, pixel);
  }
}

inline void write_rgb(const TileState& state, glm::ivec2 origin_px, glm::ivec2 size_px,
                      const HostImage& image) {
  const hn::ScalableTag<float> d;
  for (int y = 0; y < size_px.y; ++y) {
    alignas(64) float row[3 * tile_px];
    for (int x = 0; x < tile_px; x += lanes) {
      const int at = y * tile_px + x;
      hn::StoreInterleaved3(hn::Load(d, state.red + at), hn::Load(d, state.green + at),
                            hn::Load(d, state.blue + at), d, row + 3 * x);
    }
    std::memcpy(image.rgb_row(origin_px.y + y) + 3 * origin_px.x, row,
                static_cast<std::size_t>(size_px.x) * 3 * sizeof(float));
  }
}

/// Rounds codes to bytes.
template <class D>
HWY_INLINE void store_codes(const Lanes<D>& codes, std::uint8_t* out) {
  const hn::Rebind<std::uint8_t, D> bytes;
  hn::StoreU(hn::DemoteTo(bytes, hn::NearestInt(codes.v)), bytes, out);
}

/// Mean of the 2x2 pixels under each chroma sample, for all samples of two rows of one channel.
HWY_INLINE void average_2x2(const float* two_rows, float* out) {
  constexpr std::size_t half_tile = tile_px / 2;
  const hn::CappedTag<float, half_tile> d;
  for (std::size_t x = 0; x < half_tile; x += hn::Lanes(d)) {
    hn::Vec<decltype(d)> even_0, odd_0, even_1, odd_1;
    hn::LoadInterleaved2(d, two_rows + 2 * x, even_0, odd_0);
    hn::LoadInterleaved2(d, two_rows + tile_px + 2 * x, even_1, odd_1);
    const auto sum = hn::Add(hn::Add(even_0, odd_0), hn::Add(even_1, odd_1));
    hn::Store(hn::Mul(sum, hn::Set(d, 0.25f)), d, out + x);
  }
}

inline void write_i420(const TileState& state, glm::ivec2 origin_px, glm::ivec2 size_px,
                       const HostImage& image) {
  const auto width = static_cast<std::size_t>(size_px.x);
  std::uint8_t codes[2][tile_px];
  for (int y = 0; y < size_px.y; ++y) {
    for (int x = 0; x < tile_px; x += lanes)
      store_codes(luma_code(state.load(y * tile_px + x).colour), codes[0] + x);
    std::memcpy(image.byte_row(0, origin_px.y + y) + origin_px.x, codes[0], width);
  }
  using D = hn::CappedTag<float, tile_px / 2>;
  for (int y = 0; y < size_px.y; y += 2) {
    alignas(64) float mean[3][tile_px / 2];
    average_2x2(state.red + y * tile_px, mean[0]);
    average_2x2(state.green + y * tile_px, mean[1]);
    average_2x2(state.blue + y * tile_px, mean[2]);
    for (std::size_t x = 0; x < tile_px / 2; x += hn::Lanes(D())) {
      const Vec2<Lanes<D>> chroma = chroma_codes(Vec3<Lanes<D>>{
          Lanes<D>::load(mean[0] + x), Lanes<D>::load(mean[1] + x), Lanes<D>::load(mean[2] + x)});
      store_codes(chroma.x, codes[0] + x);
      store_codes(chroma.y, codes[1] + x);
    }
    for (int plane = 1; plane < 3; ++plane)
      std::memcpy(image.byte_row(plane, (origin_px.y + y) / 2) + origin_px.x / 2, codes[plane - 1],
                  width / 2);
  }
}

inline std::uint64_t blend_tile(const BlendTask& task) {
  const glm::ivec2 origin_px = task.tile * tile_px;
  const glm::ivec2 size_px = glm::min(task.image->size_px() - origin_px, glm::ivec2(tile_px));
  TileState state;
  clear(state, size_px);
  std::uint64_t pairs = 0;
  if (task.count_pairs) {
    pairs = task.cull_blocks ? blend_list<true, true>(state, task)
                             : blend_list<false, true>(state, task);
  } else {
    pairs = task.cull_blocks ? blend_list<true, false>(state, task)
                             : blend_list<false, false>(state, task);
  }
  resolve_tile(state, task.background);
  if (task.image->format() == PixelFormat::rgb_f32) {
    write_rgb(state, origin_px, size_px, *task.image);
  } else {
    write_i420(state, origin_px, size_px, *task.image);
  }
  return pairs;
}

}  // namespace HWY_NAMESPACE
}  // namespace catgs
HWY_AFTER_NAMESPACE();

#endif

#if defined(CATGS_CPU_PIXELS_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef CATGS_CPU_PIXELS_INL_H
#undef CATGS_CPU_PIXELS_INL_H
#else
#define CATGS_CPU_PIXELS_INL_H
#endif

#include <algorithm>
#include <cmath>
#include <cstring>

#include "render_core/cpu/kernels.h"
#include "render_core/cpu/lanes-inl.h"
#include "render_core/math/blend-inl.h"
#include "render_core/math/colour-inl.h"

HWY_BEFORE_NAMESPACE();
namespace catgs {
namespace HWY_NAMESPACE {

inline constexpr int lanes = static_cast<int>(Floats::count);
static_assert(block_px % lanes == 0, "a block is whole registers");

/// Column and row of each pixel of a block.
alignas(64) inline constexpr float columns_in_block[block_px] = {0, 1, 2, 3, 0, 1, 2, 3,
                                                                 0, 1, 2, 3, 0, 1, 2, 3};
alignas(64) inline constexpr float rows_in_block[block_px] = {0, 0, 0, 0, 1, 1, 1, 1,
                                                              2, 2, 2, 2, 3, 3, 3, 3};

/// The pixels of a block while they are blended. All planes are side by side in one struct. If the
/// planes of a block were a power of two apart, stores would delay each other, because processors
/// compare addresses by their low bits.
struct alignas(64) BlockPixels {
  float red[block_px], green[block_px], blue[block_px];
  float transmittance[block_px];  // as in PixelState
  float half_depth[block_px];     // of the splat that stops half of the light; only where wanted

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

/// Empty pixels; those beyond the first `inside_px` columns and rows are finished from the start.
inline void clear(BlockPixels& pixels, glm::ivec2 inside_px) {
  const Floats width(static_cast<float>(inside_px.x)), height(static_cast<float>(inside_px.y));
  for (int at = 0; at < block_px; at += lanes) {
    PixelState<Floats> pixel = empty_pixel<Floats>();
    const auto inside =
        (Floats::load(columns_in_block + at) < width) & (Floats::load(rows_in_block + at) < height);
    pixel.transmittance = select(inside, pixel.transmittance, Floats(0.0));
    pixels.store(at, pixel);
    Floats(INFINITY).store(pixels.half_depth + at);
  }
}

/// The inverse depth that a block shows: of its 2x2 middle pixels, the second of the nearest. 0 for
/// a pixel that lets half of the light pass.
inline float shown_inverse_depth(const BlockPixels& pixels) {
  constexpr int first = (block_side_px / 2 - 1) * (block_side_px + 1);
  const auto inverse_depth = [&](int at) {
    const bool stops = std::abs(pixels.transmittance[at]) < 0.5f;
    return stops ? 1.0f / pixels.half_depth[at] : 0.0f;
  };
  const float a = inverse_depth(first), b = inverse_depth(first + 1);
  const float c = inverse_depth(first + block_side_px);
  const float d = inverse_depth(first + block_side_px + 1);
  const float low = std::max(std::min(a, b), std::min(c, d));
  return std::max(low, std::min(std::max(a, b), std::max(c, d)));
}

/// Resolves a block over the background in place.
inline void resolve_block(BlockPixels& pixels, const glm::vec3& background, bool fills) {
  const Vec3<Floats> behind{Floats(background.x), Floats(background.y), Floats(background.z)};
  for (int at = 0; at < block_px; at += lanes) {
    PixelState<Floats> pixel = pixels.load(at);
    if (fills) pixel = filled(pixel, Floats(static_cast<float>(least_shown)));
    pixel.colour = resolve(pixel, behind);
    pixels.store(at, pixel);
  }
}

/// Copies rows of a block's part in the image, of `row_size` elements each (at most 4 pixels'
/// worth).
template <std::size_t row_size, class T, class Row>
HWY_INLINE void copy_rows(const T* rows, glm::ivec2 inside_px, std::size_t per_pixel,
                          const Row& row_of) {
  for (int y = 0; y < inside_px.y; ++y) {
    const std::size_t size = static_cast<std::size_t>(inside_px.x) * per_pixel;
    if (size == row_size) {
      std::memcpy(row_of(y), rows + row_size * y, row_size * sizeof(T));
    } else {
      std::memcpy(row_of(y), rows + row_size * y, size * sizeof(T));
    }
  }
}

inline void write_rgb(const BlockPixels& pixels, glm::ivec2 origin_px, const ImagePlanes& image) {
  const hn::ScalableTag<float> d;
  alignas(64) float rgb[3 * block_px];
  for (int at = 0; at < block_px; at += lanes)
    hn::StoreInterleaved3(hn::Load(d, pixels.red + at), hn::Load(d, pixels.green + at),
                          hn::Load(d, pixels.blue + at), d, rgb + 3 * at);
  const glm::ivec2 inside_px = glm::min(image.size_px() - origin_px, block_side_px);
  copy_rows<3 * block_side_px>(
      rgb, inside_px, 3, [&](int y) { return image.rgb_row(origin_px.y + y) + 3 * origin_px.x; });
}

/// Rounds codes to bytes.
template <class D>
HWY_INLINE void store_codes(const Lanes<D>& codes, std::uint8_t* out) {
  const hn::Rebind<std::uint8_t, D> bytes;
  hn::StoreU(hn::DemoteTo(bytes, hn::NearestInt(codes.v)), bytes, out);
}

/// Mean of the 2x2 pixels under each chroma sample of a block in one channel.
HWY_INLINE void average_2x2(const float* block, float* out) {
  for (int y = 0; y < block_side_px; y += 2, block += 2 * block_side_px) {
    for (int x = 0; x < block_side_px; x += 2) {
      *out++ = 0.25f *
               (block[x] + block[x + 1] + block[block_side_px + x] + block[block_side_px + x + 1]);
    }
  }
}

inline void write_i420(const BlockPixels& pixels, glm::ivec2 origin_px, const ImagePlanes& image) {
  constexpr int samples = block_px / 4, samples_across = block_side_px / 2;
  using L = Lanes<hn::CappedTag<float, samples>>;
  std::uint8_t luma[block_px], chroma[2][samples];
  for (int at = 0; at < block_px; at += lanes)
    store_codes(luma_code(pixels.load(at).colour), luma + at);
  alignas(64) float mean[3][samples];
  average_2x2(pixels.red, mean[0]);
  average_2x2(pixels.green, mean[1]);
  average_2x2(pixels.blue, mean[2]);
  for (int at = 0; at < samples; at += static_cast<int>(L::count)) {
    const Vec2<L> codes =
        chroma_codes(Vec3<L>{L::load(mean[0] + at), L::load(mean[1] + at), L::load(mean[2] + at)});
    store_codes(codes.x, chroma[0] + at);
    store_codes(codes.y, chroma[1] + at);
  }
  const glm::ivec2 inside_px = glm::min(image.size_px() - origin_px, block_side_px);
  copy_rows<block_side_px>(luma, inside_px, 1,
                           [&](int y) { return image.byte_row(0, origin_px.y + y) + origin_px.x; });
  for (int plane = 1; plane < 3; ++plane) {
    copy_rows<samples_across>(chroma[plane - 1], inside_px / 2, 1, [&](int y) {
      return image.byte_row(plane, origin_px.y / 2 + y) + origin_px.x / 2;
    });
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace catgs
HWY_AFTER_NAMESPACE();

#endif

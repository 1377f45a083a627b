#pragma once

#include <cstdint>

#include <cuda_fp16.h>

#include "render_core/cuda/part_pixels.cuh"
#include "render_core/math/blend-inl.h"
#include "render_core/math/ellipse-inl.h"

/// Blending on tensor cores: a half part (32 pixels) and 32 of its splats at a time.
///
/// A splat's exponent is a polynomial of degree two in the pixel's place. The exponents of 16
/// pixels and 8 splats are thus one product of matrices: (1, x, y, x^2, xy, y^2) times coefficients
/// (as in TC-GS and GEMM-GS). Places count from the middle of the part. Up to 22.5 px fp16 holds
/// their products exactly, and parts stay far below that. Coefficients are split into two halves:
/// the upper 11 bits, and the remainder, which is multiplied too.
///
/// The product leaves a pixel's exponents on four lanes. Each lane has a quarter of the splats, in
/// their order, and blends it by itself from transmittance 1. The product of the transmittances of
/// the quarters before it then scales its weights. A second product, weights times colours, sums
/// the colours; the lanes already hold its first matrix in the right places.
///
/// Unlike in math::blend, a pixel that falls below transmittance_min takes in the rest of its
/// round. It sees at most transmittance_min / (1 - alpha_max) more of what lies behind.
namespace catgs::cuda {

constexpr int round_splats = 32;
constexpr int round_lanes = 4;                       // lanes that share a pixel
constexpr int quarter = round_splats / round_lanes;  // splats of a lane
constexpr int block_pixels = 16;                     // pixels of one product
constexpr int half_blocks = half_pixels / block_pixels;
constexpr int column_splats = 8;                       // splats of the first product
constexpr int columns = round_splats / column_splats;  // number of first products
constexpr int chunks = round_splats / 16;              // number of second products

/// An exponent that contributes nothing and fits in a half.
constexpr float least_exponent = -6e4f;

// exp2 flushes results below 2^-126 to zero. Exponents are shifted so that this happens where alpha
// falls below alpha_min; alphas are scaled back with the transmittance.
constexpr float exponent_shift = static_cast<float>(-126.0 - log2_alpha_min);
constexpr float alpha_scale = static_cast<float>(0x1p126 * alpha_min);
constexpr float most_scaled_alpha = static_cast<float>(alpha_max / (0x1p126 * alpha_min));

/// A splat in halves, as both products need it. First the upper 11 bits of the pairs of
/// coefficients (1, x), (y, x^2) and (xy, y^2), each followed by the remainders; then the colour,
/// which the first product multiplies by zero. Red, green and blue are columns 4 to 6 of the last
/// eight halves.
struct StagedSplat {
  uint2 pair[round_lanes];
};

/// Two floats as halves, and the remainders as halves.
__device__ inline uint2 split_pair(float a, float b) {
  const __half2 high = __floats2half2_rn(a, b);
  const float2 rounded = __half22float2(high);
  const __half2 low = __floats2half2_rn(a - rounded.x, b - rounded.y);
  return make_uint2(reinterpret_cast<const std::uint32_t&>(high),
                    reinterpret_cast<const std::uint32_t&>(low));
}

/// `f` has its origin at that of the part; `colour` holds the words of a PackedColour.
__device__ inline StagedSplat staged_splat(const math::ExponentField<float>& f, uint2 colour) {
  const float at_origin = f.log2_opacity + exponent_shift - f.u * f.u - f.v * f.v;
  return {{split_pair(at_origin, -2.0f * f.u * f.xx),
           split_pair(-2.0f * (f.u * f.xy + f.v * f.yy), -f.xx * f.xx),
           split_pair(-2.0f * f.xx * f.xy, -(f.xy * f.xy + f.yy * f.yy)), colour}};
}

/// The halves that the square around a splat meets, a bit each. `x`, `y`: its centre, px from
/// the part's origin.
__device__ inline unsigned halves_met(float half_side_px, float x, float y) {
  constexpr float middle = 0.5f * part_side_px;
  static_assert(halves == 2 && 2 * block_height_px == part_side_px);
  if (fabsf(x) > half_side_px + middle || fabsf(y) > half_side_px + middle) return 0;
  return (y <= half_side_px ? 1u : 0u) | (y >= -half_side_px ? 2u : 0u);
}

/// Splats of a half part in order, in a ring of three rounds. Lanes read splats a quarter apart.
/// Gaps, and half a row of banks between the halves of a splat, spread the reads over all banks.
class StagedHalf {
 public:
  static constexpr unsigned room = 3 * round_splats;
  static constexpr unsigned gap = 2;  // after each quarter

  /// Requires place < 2 room.
  __device__ static unsigned wrapped(unsigned position) {
    return position < room ? position : position - room;
  }

  /// Address of pairs 2 k and 2 k + 1 of a splat.
  __device__ uint4* at(unsigned position, unsigned k) {
    return &words_[k][position + position / quarter * gap];
  }
  __device__ const uint4* at(unsigned position, unsigned k) const {
    return &words_[k][position + position / quarter * gap];
  }
  /// A predicate is cheaper than a branch.
  __device__ void put_if(bool wanted, unsigned position, const StagedSplat& splat) {
    const uint2(&p)[round_lanes] = splat.pair;
    asm volatile(
        "{.reg .pred wanted;"
        " setp.ne.u32 wanted, %0, 0;"
        " @wanted st.shared.v4.u32 [%1], {%2, %3, %4, %5};"
        " @wanted st.shared.v4.u32 [%1 + %10], {%6, %7, %8, %9};}" ::"r"(unsigned{wanted}),
        "r"(static_cast<std::uint32_t>(__cvta_generic_to_shared(at(position, 0)))), "r"(p[0].x),
        "r"(p[0].y), "r"(p[1].x), "r"(p[1].y), "r"(p[2].x), "r"(p[2].y), "r"(p[3].x), "r"(p[3].y),
        "n"(sizeof(words_[0]))
        : "memory");
  }

 private:
  uint4 words_[2][room / quarter * (quarter + gap) + 4];
};

/// d = a b + d for 16x8 halves a, 8x8 halves b and 16x8 floats d, distributed over the warp as PTX
/// defines for mma.m16n8k8.
__device__ inline void multiply_add(float (&d)[4], const std::uint32_t (&a)[2], std::uint32_t b) {
  asm("mma.sync.aligned.m16n8k8.row.col.f32.f16.f16.f32 "
      "{%0, %1, %2, %3}, {%4, %5}, {%6}, {%0, %1, %2, %3};"
      : "+f"(d[0]), "+f"(d[1]), "+f"(d[2]), "+f"(d[3])
      : "r"(a[0]), "r"(a[1]), "r"(b));
}

/// The same for 16x16 halves a and 16x8 halves b: mma.m16n8k16.
__device__ inline void multiply_add(float (&d)[4], const std::uint32_t (&a)[4], uint2 b) {
  asm("mma.sync.aligned.m16n8k16.row.col.f32.f16.f16.f32 "
      "{%0, %1, %2, %3}, {%4, %5, %6, %7}, {%8, %9}, {%0, %1, %2, %3};"
      : "+f"(d[0]), "+f"(d[1]), "+f"(d[2]), "+f"(d[3])
      : "r"(a[0]), "r"(a[1]), "r"(a[2]), "r"(a[3]), "r"(b.x), "r"(b.y));
}

/// Loads four 8x8 matrices of halves as the second factors of two products. Lane l passes the
/// address of row l % 8 of matrix l / 8.
__device__ inline void load_columns(uint2 (&b)[chunks], const void* row) {
  const auto address = static_cast<std::uint32_t>(__cvta_generic_to_shared(row));
  asm volatile("ldmatrix.sync.aligned.m8n8.x4.trans.shared.b16 {%0, %1, %2, %3}, [%4];"
               : "=r"(b[0].x), "=r"(b[0].y), "=r"(b[1].x), "=r"(b[1].y)
               : "r"(address)
               : "memory");
}

__device__ inline float exp2_flushing(float x) {
  float y;
  asm("ex2.approx.ftz.f32 %0, %1;" : "=f"(y) : "f"(x));
  return y;
}

__device__ inline std::uint32_t bits_of(__half2 halves) {
  return reinterpret_cast<const std::uint32_t&>(halves);
}

/// A block of pixels, distributed over the lanes of a warp. Lane l has pixels l / 4 and l / 4 + 8:
/// their transmittances; red and green if it is the third lane of the four, blue if it is the last.
struct BlockPixels {
  float colour[4];
  float transmittance[2];
};

/// The first factors of the first product: the lane's pair out of (1, x), (y, x^2), (xy, y^2), 0,
/// for its two pixels of each block.
struct PixelPositions {
  std::uint32_t of[half_blocks][2];
};

struct HalfPixels {
  BlockPixels block[half_blocks];

  /// Whether any pixel has a transmittance of `least` or more. Called by the whole warp.
  __device__ bool live(float least) const {
    float most = 0.0f;
#pragma unroll
    for (const BlockPixels& b : block)
      most = fmaxf(most, fmaxf(b.transmittance[0], b.transmittance[1]));
    return __any_sync(~0u, most >= least);
  }
};

/// Initialises half part `half` from the warp's pixels, and sets the places of the lane's pixels.
__device__ inline HalfPixels take_half(const PartPixels& pixels, const FrameShape& shape, int half,
                                       PixelPositions& positions) {
  const int lane = static_cast<int>(threadIdx.x) % warp_size, pair = lane % round_lanes;
  HalfPixels taken;
#pragma unroll
  for (int b = 0; b < half_blocks; ++b) {
#pragma unroll
    for (int row = 0; row < 2; ++row) {
      static_assert(block_pixels == half_lanes && half_blocks == pixels_per_lane);
      const PartPixel pixel =
          pixels.part_pixel(shape, half, b, row * (block_pixels / 2) + lane / round_lanes);
      const float x = pixel.x, y = pixel.y;
      const float first = pair == 0 ? 1.0f : pair == 1 ? y : pair == 2 ? x * y : 0.0f;
      const float second = pair == 0 ? x : pair == 1 ? x * x : pair == 2 ? y * y : 0.0f;
      positions.of[b][row] = bits_of(__floats2half2_rn(first, second));
      taken.block[b].transmittance[row] = pixel.inside ? 1.0f : 0.0f;
    }
#pragma unroll
    for (float& c : taken.block[b].colour) c = 0.0f;
  }
  return taken;
}

/// The blend of a lane's quarter of a round with a block of pixels.
struct QuarterBlend {
  float scaled[2];             // the transmittance left, times alpha_scale
  __half2 weight[columns][2];  // of its splats, as if the quarter came first
};

/// `in_column`: the lane's pair of coefficients, of the splat in the lane's column of the first
/// product.
template <bool count_pairs>
__device__ QuarterBlend blend_quarter(const BlockPixels& pixels,
                                      const std::uint32_t (&positions)[2], const uint2* in_column,
                                      float least, unsigned& pairs) {
  QuarterBlend blend{{alpha_scale, alpha_scale}, {}};
#pragma unroll
  for (int j = 0; j < columns; ++j) {
    const uint2 field = in_column[2 * j * (sizeof(uint4) / sizeof(uint2))];
    float exponent[4] = {};
    multiply_add(exponent, positions, field.y);
    multiply_add(exponent, positions, field.x);
#pragma unroll
    for (int row = 0; row < 2; ++row) {
      float weight[2];
#pragma unroll
      for (int k = 0; k < 2; ++k) {
        const float alpha = fminf(exp2_flushing(exponent[2 * row + k]), most_scaled_alpha);
        weight[k] = alpha * blend.scaled[row];
        blend.scaled[row] = fmaf(weight[k], -alpha_scale, blend.scaled[row]);
        if (count_pairs) pairs += alpha > 0.0f && pixels.transmittance[row] >= least;
      }
      blend.weight[j][row] = __floats2half2_rn(weight[0], weight[1]);
    }
  }
  return blend;
}

/// Blends the staged splats at first, first + 1, … first + 31 into the pixels of a half part whose
/// transmittance is `least` or more. Returns the number of pairs that the lane blended if
/// `count_pairs`.
template <bool count_pairs>
__device__ unsigned blend_round(HalfPixels& pixels, const PixelPositions& positions,
                                const StagedHalf& staged, unsigned first, float least) {
  const unsigned lane = threadIdx.x % warp_size;
  // Columns 2 l and 2 l + 1 of the first product are two neighbours in the quarter of lane l.
  const unsigned column = lane / round_lanes;
  const uint2* in_column = reinterpret_cast<const uint2*>(staged.at(
                               first + column / 2 * quarter + column % 2, lane % round_lanes / 2)) +
                           lane % 2;
  unsigned pairs = 0;
  QuarterBlend mine[half_blocks];
#pragma unroll
  for (int b = 0; b < half_blocks; ++b)
    mine[b] = blend_quarter<count_pairs>(pixels.block[b], positions.of[b], in_column, least, pairs);
  // Row r of a matrix of colours belongs to the splat in column r of the first product.
  const unsigned row_of_matrix = lane % column_splats, matrix = lane / column_splats;
  uint2 colours[chunks];
  load_columns(colours,
               staged.at(first + row_of_matrix / 2 * quarter + 2 * matrix + row_of_matrix % 2, 1));
  float neighbour[half_blocks][2], other_pair[half_blocks][2];
#pragma unroll
  for (int b = 0; b < half_blocks; ++b) {
#pragma unroll
    for (int row = 0; row < 2; ++row) {
      mine[b].scaled[row] *= 1.0f / alpha_scale;
      neighbour[b][row] = __shfl_xor_sync(~0u, mine[b].scaled[row], 1);
    }
  }
#pragma unroll
  for (int b = 0; b < half_blocks; ++b) {
#pragma unroll
    for (int row = 0; row < 2; ++row) {
      mine[b].scaled[row] *= neighbour[b][row];
      other_pair[b][row] = __shfl_xor_sync(~0u, mine[b].scaled[row], 2);
    }
  }
#pragma unroll
  for (int b = 0; b < half_blocks; ++b) {
    BlockPixels& block = pixels.block[b];
    __half2 factor[2];
#pragma unroll
    for (int row = 0; row < 2; ++row) {
      float before = block.transmittance[row] >= least ? block.transmittance[row] : 0.0f;
      if (lane % 2 != 0) before *= neighbour[b][row];
      if (lane / 2 % 2 != 0) before *= other_pair[b][row];
      factor[row] = __float2half2_rn(before);
      block.transmittance[row] *= mine[b].scaled[row] * other_pair[b][row];
    }
#pragma unroll
    for (int chunk = 0; chunk < chunks; ++chunk) {
      const __half2(&weight)[columns][2] = mine[b].weight;
      const std::uint32_t weights[4] = {bits_of(weight[2 * chunk][0] * factor[0]),
                                        bits_of(weight[2 * chunk][1] * factor[1]),
                                        bits_of(weight[2 * chunk + 1][0] * factor[0]),
                                        bits_of(weight[2 * chunk + 1][1] * factor[1])};
      multiply_add(block.colour, weights, colours[chunk]);
    }
  }
  return pairs;
}

}  // namespace catgs::cuda

#pragma once

#include <algorithm>

#include <glm/vec2.hpp>

#include "render_core/cuda/frame_arrays.cuh"
#include "render_core/math/homography-inl.h"

namespace catgs::cuda {

// A turn of the camera changes all depths in one direction by one and the same share: what is seen
// at p at depth z was at weight_at(list_from_frame, p) z in the key frame. So the order of a
// tile's list changes little, but for Gaussians so large that the tile sees them far from their
// centres: these have another share, belong thousands of entries away, and are the giants.

/// By how much a turn's shares of depths differ across `extent_px`.
template <class T>
__host__ __device__ T depth_spread(const Homography<T>& list_from_frame, math::Vec2<T> extent_px) {
  return std::abs(list_from_frame.wx) * extent_px.x + std::abs(list_from_frame.wy) * extent_px.y;
}

/// Turns of a smaller spread over the picture have no giants worth a search. (One H200, fungi_room:
/// with 0.01 drone has a switch between frames of 2 / 255; with 0 nothing changes.)
constexpr double least_spread = 0.003;

/// By how much a giant's share varies at least from its centre to where its footprint ends: by as
/// much as across one and a half pictures, or by 3 %. (The same: with 3 % alone, slow turns of
/// drone leave blocks of 34 dB; with 0.375 pictures or 1 %, fast ones have more giants than can
/// move, and head2 blocks of 28 and 20 dB. With 5 % one switch of head2 is 1.7 / 255, with 8 % two
/// are up to 3.7.)
inline float giant_variation(double spread) {
  return std::min(static_cast<float>(1.5 * spread), 0.03f);
}

/// The giants of a group of frames: bit slot % giant_bits is set for each, so that others may seem
/// to be some. Who is one in a frame remains one: a later frame's turn may lead back, and the list
/// stands in the order of the frame before.
constexpr std::uint32_t giant_words = 1024, giant_bits = giant_words * warp_size;
__device__ inline std::uint32_t giant_word(std::uint32_t slot) {
  return slot / warp_size % giant_words;
}
__device__ inline std::uint32_t giant_bit(std::uint32_t slot) { return 1u << slot % warp_size; }

struct GiantSet {
  Homography<float> list_from_frame{};
  float least_variation = 0.0f;   // see giant_variation()
  std::uint32_t* bits = nullptr;  // [giant_words], zero at first; null: nobody asks for giants

  /// Whether a Gaussian that reaches so far is one in some tile; any that was behind the key
  /// frame's camera, too.
  __device__ bool is_giant(float2 centre_px, float2 half_px) const {
    const float varies = depth_spread<float>(list_from_frame, {half_px.x, half_px.y});
    const float share = math::weight_at<float>(list_from_frame, {centre_px.x, centre_px.y});
    return varies > least_variation * share;
  }
};

/// Carries giants to those runs of their tiles' lists that their depths lie in, or from behind all
/// runs into them, or out. Runs keep their lengths: where more giants pass a boundary one way than
/// the other, as many of the entries beside it go back. Within runs launch_reorder() does the rest.
struct GiantParams {
  FrameShape shape;
  const std::uint32_t* bits;       // GiantSet::bits
  const uint2* range;              // [tiles]
  const std::uint32_t* ordered;    // [tiles], how many of its entries are in runs
  const std::uint32_t* depth_key;  // [visible_bound], of this frame
  std::uint32_t* slot;             // [list_bound]
  FrameCounts* counts;
  int processors;  // of the device
};
void launch_giants(const GiantParams& params, cudaStream_t stream);

}  // namespace catgs::cuda

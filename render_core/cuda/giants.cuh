#pragma once

#include <algorithm>

#include <glm/vec2.hpp>

#include "render_core/cuda/frame_arrays.cuh"
#include "render_core/math/homography-inl.h"

namespace catgs::cuda {

// A turn of the camera changes all depths along one direction by the same factor. A point seen at p
// at depth z was at depth weight_at(list_from_frame, p) z in the key frame. The order of a tile's
// list therefore changes little, except for Gaussians so large that the tile sees them far from
// their centres. These have another factor and move by thousands of entries; they are the giants.

/// The difference of a turn's depth factors across `extent_px`.
template <class T>
__host__ __device__ T depth_spread(const Homography<T>& list_from_frame, math::Vec2<T> extent_px) {
  return std::abs(list_from_frame.wx) * extent_px.x + std::abs(list_from_frame.wy) * extent_px.y;
}

/// Turns with a smaller spread over the picture have no giants worth a search. Measured on one H200
/// with fungi_room: with 0.01, drone has a switch between frames of 2 / 255; with 0 nothing
/// changes.
constexpr double least_spread = 0.003;

/// The least variation of a giant's factor from its centre to the edge of its footprint: as much as
/// across one and a half pictures, or 3 %. Measured on the same: with 3 % alone, slow turns of
/// drone leave blocks of 34 dB. With 0.375 pictures or 1 %, fast turns have more giants than can
/// move, and head2 has blocks of 28 and 20 dB. With 5 %, one switch of head2 is 1.7 / 255; with 8
/// %, two are up to 3.7.
inline float giant_variation(double spread) {
  return std::min(static_cast<float>(1.5 * spread), 0.03f);
}

/// The giants of a group of frames. Each sets bit slot % giant_bits, so other Gaussians may be
/// taken for giants too. A giant of one frame remains one in the group, because a later turn may
/// lead back while the list still has the order of the frame before.
constexpr std::uint32_t giant_words = 1024, giant_bits = giant_words * warp_size;
__device__ inline std::uint32_t giant_word(std::uint32_t slot) {
  return slot / warp_size % giant_words;
}
__device__ inline std::uint32_t giant_bit(std::uint32_t slot) { return 1u << slot % warp_size; }

struct GiantSet {
  Homography<float> list_from_frame{};
  float least_variation = 0.0f;   // see giant_variation()
  std::uint32_t* bits = nullptr;  // [giant_words], zero at first; null: giants are not looked for

  /// Whether a Gaussian that reaches this far is a giant in some tile. A Gaussian that was behind
  /// the key frame's camera always is.
  __device__ bool is_giant(float2 centre_px, float2 half_px) const {
    const float varies = depth_spread<float>(list_from_frame, {half_px.x, half_px.y});
    const float share = math::weight_at<float>(list_from_frame, {centre_px.x, centre_px.y});
    return varies > least_variation * share;
  }
};

/// Carries giants to the runs of their tiles' lists that their depths belong to, also between runs
/// and the rest of the list. Runs keep their lengths: where more giants pass a boundary in one
/// direction than in the other, as many entries next to it move back. launch_reorder() then sorts
/// within runs.
struct GiantParams {
  FrameShape shape;
  const std::uint32_t* bits;       // GiantSet::bits
  const uint2* range;              // [tiles]
  const std::uint32_t* ordered;    // [tiles], number of entries that are in runs
  const std::uint32_t* depth_key;  // [visible_bound], of this frame
  std::uint32_t* slot;             // [list_bound]
  FrameCounts* counts;
  int processors;  // of the device
};
void launch_giants(const GiantParams& params, cudaStream_t stream);

}  // namespace catgs::cuda

#pragma once

#include "render_core/cuda/frame_arrays.cuh"
#include "render_core/math/constants.h"
#include "render_core/math/ellipse-inl.h"
#include "render_core/math/trail-inl.h"

namespace catgs::cuda {

/// The path of a splat through a key frame's window, which decides its lists: a math::Sweep.
struct __align__(16) SplatPath {
  float dx, dy;                      // px, from the record's centre
  math::Whitening<float> whitening;  // of the outline
  float log2_opacity;                // the record has none while the splat is behind the near plane
  float x, y;                        // px, the record's centre in the key frame
};
static_assert(sizeof(SplatPath) == 32);

constexpr float least_slack_px = static_cast<float>(listing_slack_px);

/// How much wider than its path a splat is listed, so that a camera may leave its forecast: a
/// wrong position moves near splats the most.
struct ListSlack {
  float far_px = 0.0f;   // what a wrong direction adds, at any depth
  float near_px = 0.0f;  // px times world units: what a wrong position adds at depth 1
  float most_px = 0.0f;

  /// `depth`: view depth; a splat that comes from behind the camera may be anywhere.
  __device__ float at(float depth) const {
    return depth > 0.0f ? fminf(far_px + near_px / depth, most_px) : most_px;
  }
};

/// The tiles that an outline (math::Ellipse or math::Trail) reaches: rows first_row…last_row, and
/// in each row columns by `columns`.
template <class Outline>
struct TileFootprint {
  Outline outline;
  float2 centre_px;
  float slack_px;  // px that rows and columns are widened by, against rounding
  float top_px, bottom_px;
  int first_row, last_row;
  FrameShape shape;

  /// First and last column of one tile row; empty when first > last. A tile counts when the
  /// rectangle of its pixel centres, within the picture, meets the outline.
  __device__ int2 columns(int row) const {
    constexpr float tile = tile_side_px;
    const float top = static_cast<float>(row) * tile + 0.5f;
    const float bottom =
        fminf(top + (tile - 1.0f), static_cast<float>(shape.grid_height_px) - 0.5f);
    const auto cut = math::columns_in_band(outline, top - slack_px - centre_px.y,
                                           bottom + slack_px - centre_px.y);
    const float low = cut.low + centre_px.x - slack_px;
    const float high = cut.high + centre_px.x + slack_px;
    if (cut.low > cut.high || low > static_cast<float>(shape.grid_width_px) - 0.5f)
      return make_int2(0, -1);
    const float first = ceilf((low - (tile - 0.5f)) * (1.0f / tile));
    const float last = floorf((high - 0.5f) * (1.0f / tile));
    return make_int2(static_cast<int>(fmaxf(first, 0.0f)),
                     static_cast<int>(fminf(last, static_cast<float>(shape.tiles_x - 1))));
  }

  /// The blocks of a tile that the outline reaches: TileEntry::blocks.
  __device__ std::uint32_t blocks(int column, int row) const {
    constexpr float width = block_width_px, height = block_height_px;
    const float left = static_cast<float>(column * tile_side_px) - centre_px.x;
    const float top = static_cast<float>(row * tile_side_px) - centre_px.y;
    const int first = max(__float2int_rd((top_px - centre_px.y - top) * (1.0f / height)), 0);
    const int last =
        min(__float2int_rd((bottom_px - centre_px.y - top) * (1.0f / height)), blocks_down - 1);
    // Column k is reached if its last pixel centre is not left of the cut, and its first one not
    // right of it.
    const float from = (-left - slack_px - (width - 0.5f)) * (1.0f / width);
    const float to = (-left + slack_px - 0.5f) * (1.0f / width);
    std::uint32_t blocks = 0;
    for (int k = first; k <= last; ++k) {
      const float y = top + static_cast<float>(k) * height + 0.5f;
      const auto cut = math::columns_in_band(outline, y - slack_px, y + (height - 1.0f) + slack_px);
      const int low = max(__float2int_ru(fmaf(cut.low, 1.0f / width, from)), 0);
      const int high = min(__float2int_rd(fmaf(cut.high, 1.0f / width, to)), blocks_across - 1);
      if (cut.low <= cut.high && low <= high)
        blocks |= ((2u << high) - (1u << low)) << (k * blocks_across);
    }
    return blocks;
  }

  /// Sets the rows for an outline that covers `top`…`bottom` (px, from its centre).
  __device__ void set_rows(float top, float bottom) {
    constexpr float tile = tile_side_px;
    top_px = top + centre_px.y - slack_px;
    bottom_px = bottom + centre_px.y + slack_px;
    const float first = ceilf((top_px - (tile - 0.5f)) * (1.0f / tile));
    const float last = floorf((bottom_px - 0.5f) * (1.0f / tile));
    first_row = static_cast<int>(fmaxf(first, 0.0f));
    last_row = static_cast<int>(fminf(last, static_cast<float>(shape.tiles_y - 1)));
    if (!(first <= last)) last_row = first_row - 1;
  }
};

/// Footprint of a splat in its present place. It reaches nothing when `log2_opacity` is too low.
__device__ inline TileFootprint<math::Ellipse<float>> make_footprint(
    float2 centre_px, const math::Whitening<float>& w, float log2_opacity, const FrameShape& shape,
    float slack_px = least_slack_px) {
  const float reach = math::reach_of(log2_opacity);
  const math::Vec2<float> half = math::half_extent(w, fmaxf(reach, 0.0f));
  TileFootprint<math::Ellipse<float>> f;
  f.outline = math::make_ellipse(w, reach, half.x, math::rightmost_y(w, fmaxf(reach, 0.0f)));
  f.centre_px = centre_px;
  f.slack_px = slack_px;
  f.shape = shape;
  f.set_rows(-half.y, half.y);
  if (reach < 0.0f) f.last_row = f.first_row - 1;
  return f;
}

/// Footprint of a splat's path through a window.
__device__ inline TileFootprint<math::Trail<float>> make_footprint(
    float2 centre_px, const SplatPath& path, const FrameShape& shape,
    float slack_px = least_slack_px) {
  const math::Whitening<float>& w = path.whitening;
  const float reach = fmaxf(math::reach_of(path.log2_opacity), 0.0f);
  const float half_x = math::half_extent(w, reach).x;
  TileFootprint<math::Trail<float>> f;
  f.outline = math::make_trail(math::make_ellipse(w, reach, half_x, math::rightmost_y(w, reach)),
                               {path.dx, path.dy});
  f.centre_px = centre_px;
  f.slack_px = slack_px;
  f.shape = shape;
  f.set_rows(f.outline.top_y, f.outline.bottom_y);
  return f;
}

/// TileEntry::blocks of a splat that stays within `slack_px` of its place. Cuts it into columns of
/// blocks, which a tile has fewer of than rows.
__device__ inline std::uint32_t blocks_of(float2 centre_px, const math::Whitening<float>& w,
                                          float log2_opacity, int column, int row,
                                          float2 slack_px = {least_slack_px, least_slack_px}) {
  constexpr float width = block_width_px, height = block_height_px;
  const float reach = math::reach_of(log2_opacity);
  if (reach < 0.0f) return 0;
  const math::Ellipse<float> turned = math::make_transposed_ellipse(w, reach);
  const float half_width = math::half_extent(w, reach).x + slack_px.x;
  const float left = static_cast<float>(column * tile_side_px) - centre_px.x;
  const float top = static_cast<float>(row * tile_side_px) - centre_px.y;
  const int first = max(__float2int_rd((-half_width - left) * (1.0f / width)), 0);
  const int last = min(__float2int_rd((half_width - left) * (1.0f / width)), blocks_across - 1);
  std::uint32_t blocks = 0;
  for (int k = first; k <= last; ++k) {
    const float x = left + static_cast<float>(k) * width + 0.5f;
    const auto cut = math::columns_in_band(turned, x - slack_px.x, x + (width - 1.0f) + slack_px.x);
    // Row j is reached if its last pixel centre is not above the cut, and its first one not below.
    const int low =
        max(__float2int_ru((cut.low - top - slack_px.y - (height - 0.5f)) * (1.0f / height)), 0);
    const int high = min(__float2int_rd((cut.high - top + slack_px.y - 0.5f) * (1.0f / height)),
                         blocks_down - 1);
    if (cut.low > cut.high || low > high) continue;
    constexpr std::uint32_t every_row = 0x11111111u;
    static_assert(blocks_across == 4 && blocks_down == 8);
    const std::uint32_t rows = (every_row << (blocks_across * low)) &
                               (every_row >> (blocks_across * (blocks_down - 1 - high)));
    blocks |= rows << k;
  }
  return blocks;
}

/// A path so short that its outline, wider by half of it, stands for its trail: that is cut faster.
__device__ inline bool is_short(const SplatPath& path) {
  constexpr float most_px = 6.0f;
  return fmaxf(fabsf(path.dx), fabsf(path.dy)) <= most_px;
}
__device__ inline float2 middle_of(const SplatPath& path) {
  return make_float2(path.x + 0.5f * path.dx, path.y + 0.5f * path.dy);
}

/// Calls visit() with the footprint of a path.
template <class Visit>
__device__ auto with_footprint(const SplatPath& path, const FrameShape& shape, float slack_px,
                               const Visit& visit) {
  if (!is_short(path))
    return visit(make_footprint(make_float2(path.x, path.y), path, shape, slack_px));
  const float half_path_px = 0.5f * fmaxf(fabsf(path.dx), fabsf(path.dy));
  return visit(make_footprint(middle_of(path), path.whitening, path.log2_opacity, shape,
                              slack_px + half_path_px));
}

/// TileEntry::blocks of a splat that stays within `slack_px` of its path.
__device__ inline std::uint32_t blocks_of(const SplatPath& path, const FrameShape& shape,
                                          int column, int row, float slack_px) {
  if (!is_short(path))
    return make_footprint(make_float2(path.x, path.y), path, shape, slack_px).blocks(column, row);
  return blocks_of(middle_of(path), path.whitening, path.log2_opacity, column, row,
                   make_float2(slack_px + 0.5f * fabsf(path.dx), slack_px + 0.5f * fabsf(path.dy)));
}

/// The tiles of a small splat, row by row. Most splats are small, so their tiles are kept between
/// counting and listing.
struct TileSpans {
  static constexpr int most_rows = 4;
  static constexpr unsigned not_small = 255;  // in place of rows: the tiles have to be found again
  // x: first row, leftmost column << 16; y: number of rows. z: first column of each row, from the
  // leftmost, a byte per row; w: number of columns of each row, likewise.
  uint4 packed;

  __device__ std::uint32_t row() const { return packed.x & 0xffffu; }
  __device__ std::uint32_t column() const { return packed.x >> 16; }
  __device__ std::uint32_t rows() const { return packed.y; }
  __device__ int first(int j) const { return static_cast<int>(packed.z >> (8 * j) & 0xffu); }
  __device__ int count(int j) const { return static_cast<int>(packed.w >> (8 * j) & 0xffu); }
};

/// Finds the tiles of a footprint, and returns their number.
template <class Outline>
__device__ std::uint32_t find_tiles(const TileFootprint<Outline>& f, TileSpans& spans) {
  const int rows = max(0, f.last_row - f.first_row + 1);
  std::uint32_t tiles = 0;
  spans.packed = make_uint4(0, TileSpans::not_small, 0, 0);
  if (rows > TileSpans::most_rows) {
    for (int row = f.first_row; row <= f.last_row; ++row) {
      const int2 columns = f.columns(row);
      tiles += static_cast<std::uint32_t>(max(0, columns.y - columns.x + 1));
    }
    return tiles;
  }
  int first[TileSpans::most_rows], count[TileSpans::most_rows];
  int leftmost = 0xffff, rightmost = -1;
#pragma unroll
  for (int j = 0; j < TileSpans::most_rows; ++j) {
    const int2 columns = j < rows ? f.columns(f.first_row + j) : make_int2(0, -1);
    first[j] = columns.x;
    count[j] = max(0, columns.y - columns.x + 1);
    if (count[j] > 0) leftmost = min(leftmost, columns.x);
    if (count[j] > 0) rightmost = max(rightmost, columns.y);
    tiles += static_cast<std::uint32_t>(count[j]);
  }
  if (rightmost - leftmost > 250) return tiles;
  uint4 packed = make_uint4(
      static_cast<std::uint32_t>(f.first_row) | static_cast<std::uint32_t>(leftmost) << 16,
      static_cast<std::uint32_t>(rows), 0, 0);
#pragma unroll
  for (int j = 0; j < TileSpans::most_rows; ++j) {
    if (count[j] == 0) continue;
    packed.z |= static_cast<std::uint32_t>(first[j] - leftmost) << (8 * j);
    packed.w |= static_cast<std::uint32_t>(count[j]) << (8 * j);
  }
  spans.packed = packed;
  return tiles;
}

}  // namespace catgs::cuda

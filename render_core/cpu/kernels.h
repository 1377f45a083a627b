#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <span>
#include <string_view>
#include <vector>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "render_core/cpu/depth_limits.h"
#include "render_core/cpu/list_sort.h"
#include "render_core/cpu/scene_store.h"
#include "render_core/frame/renderer.h"
#include "render_core/image/host_image.h"
#include "render_core/math/camera.h"
#include "render_core/motion/frame_groups.h"

namespace catgs {

/// A visible Gaussian in the image plane: one cache line. Projection writes it; binning and
/// blending read it.
struct alignas(64) Splat {
  float centre_x, centre_y;          // px
  float whitening_xx, whitening_xy;  // math::Whitening
  float whitening_yy, log2_opacity;
  float half_extent_x;  // px, of the ellipse alpha >= alpha_min
  float unused;
  float red, green, blue;
  float depth;  // world units along the view axis
  std::uint32_t scene_order;
  std::uint16_t tile_x, tile_y, tile_end_x, tile_end_y;  // its box of tiles, end exclusive
  float rightmost_y;  // px below the centre: where the ellipse alpha >= alpha_min is rightmost
};

/// log2_opacity of a splat that draws nothing now, because it is behind the near plane in this
/// frame, though not in every frame of its window.
inline constexpr float hidden_log2_opacity = -128.0f;

/// The path of a splat until the end of its key frame's window, and an ellipse that holds it all
/// along the way.
struct alignas(32) SplatPath {
  float dx, dy;                                    // px
  float whitening_xx, whitening_xy, whitening_yy;  // of that ellipse
  float log2_opacity;                              // of the Gaussian, even while it is hidden
  float half_extent_x, rightmost_y;                // of that ellipse, as in Splat
};

/// Members of a cluster, a bit each.
using ClusterMembers = std::array<std::uint32_t, cluster_size / 32>;

/// The colours of a cluster that need no shading, and room for the others.
struct ClusterColours {
  float* rgb;              // [channel][Gaussian of the cluster]; null: none are kept
  ClusterMembers* shaded;  // the colours that hold
};

/// The right eye of a frame with two. It differs from the left one in its projection and in its
/// position across the view axis, so the two share depths.
struct SecondEye {
  const Camera* camera = nullptr;  // null: the frame has one eye
  Splat* splats = nullptr;         // as those of the first eye
  DepthLimits limits{};
  ClusterColours colours{nullptr, nullptr};
};

/// Projects and shades the Gaussians of one cluster. The visible ones go to the front of `splats`,
/// which has room for the whole cluster.
struct ProjectTask {
  const SceneStore* scene;
  const Camera* camera;
  // Defines which Gaussians are visible, and the tiles of a splat's box. vanilla: as in the
  // original; exact and catgs: where the ellipse is; paper: where the trail is until the window's
  // end.
  Pipeline pipeline;
  std::size_t cluster;
  Splat* splats;
  float min_depth;       // world units; nearer Gaussians do not count in ClusterSummary
  float share = 1.0f;    // of the cluster that is drawn, see math/fade-inl.h
  DepthLimits limits{};  // Gaussians behind them are not visible
  ClusterColours colours{nullptr, nullptr};
  // For paper only.
  const Camera* window_end = nullptr;
  SplatPath* paths = nullptr;         // as splats
  ClusterMembers* members = nullptr;  // the visible ones
  SecondEye second{};                 // not with a window
};

/// Projects and shades `members` of a cluster like project_cluster(), but without culling: the n-th
/// member is always splats[n].
struct RefreshTask {
  const SceneStore* scene;
  const Camera* camera;
  std::size_t cluster;
  const ClusterMembers* members;
  Splat* splats;  // without the fields that only listing needs
  float min_depth;
  float share;
  ClusterColours colours;
};

struct ClusterSummary {
  std::uint32_t visible = 0;  // splats written
  // Over splats deeper than min_depth.
  std::uint32_t counted = 0;
  float nearest_depth = std::numeric_limits<float>::infinity();
  float inverse_depth_sum = 0.0f;
  float longest_path_px = 0.0f;
  std::uint32_t visible_to_second = 0;  // splats written for the second eye
};

/// Neighbouring tiles of one row that list the same splat.
struct TileRun {
  std::uint16_t row, begin, end;  // tiles; end exclusive
  DepthSlot entry;
};

/// Lists splats for the tiles that their ellipses alpha >= alpha_min meet, or their trails.
struct ListTask {
  std::span<const Splat> splats;
  const SplatPath* paths;  // as splats; null: ellipses are listed, not trails
  std::uint32_t first_slot;
  DepthLimits limits;  // tiles that a splat is behind do not list it
  int first_row = 0;   // of the splats' tiles in the lists
};

/// Pixels are blended in blocks of 4x4, which are culled as one: a register where that is wide
/// enough. A square is met by fewer splats than a row of as many pixels.
inline constexpr int block_side_px = 4;
inline constexpr int block_px = block_side_px * block_side_px;

inline constexpr int blocks_per_tile = tile_size_px * tile_size_px / block_px;

/// Blends a tile's list and writes the tile's pixels to the image.
struct BlendTask {
  const Splat* splats;
  std::span<const DepthSlot> list;  // front to back
  glm::ivec2 first_px;              // of the tile, in the image
  glm::vec3 background;
  bool cull_blocks;  // skip blocks that a splat's ellipse misses; same image
  // A block is finished where all its pixels are below least_shown, and is then filled. Else each
  // pixel is finished before transmittance_min.
  bool fills;
  bool count_pairs;
  const ImagePlanes* image;
  PartEnds ends;    // of the tile, to be noted where it fills
  PartEnds depths;  // of the tile, to be noted: inverse, see DepthGrid
};

/// Finds the limits of a row of parts: math::occlusion_limit().
struct LimitTask {
  const Camera* now;
  const Camera* last;
  const float* deepest;  // the deepest end around each part of the last picture, by rows
  int stride;            // of these rows
  glm::ivec2 parts;      // of both pictures: columns and rows
  int row;
  float* limits;  // [column]
};

/// The stages that are compiled once per instruction set.
struct SimdKernels {
  std::string_view name;
  void (*find_limits)(const LimitTask& task);
  ClusterSummary (*project_cluster)(const ProjectTask& task);
  ClusterSummary (*refresh_cluster)(const RefreshTask& task);
  void (*list_tiles)(const ListTask& task, std::vector<TileRun>& runs);  // appends
  /// Returns the (Gaussian, pixel) pairs blended, when counted.
  std::uint64_t (*blend_tile)(const BlendTask& task);
};

/// Kernels for instruction sets that this processor has, best first; the last is "SCALAR".
std::span<const SimdKernels> simd_kernels();

}  // namespace catgs

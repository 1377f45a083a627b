#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <span>
#include <string_view>
#include <vector>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "render_core/cpu/list_sort.h"
#include "render_core/cpu/scene_store.h"
#include "render_core/image/host_image.h"
#include "render_core/math/camera.h"
#include "render_core/motion/frame_groups.h"
#include "render_core/renderer.h"

namespace catgs {

/// A visible Gaussian in the image plane: one cache line. Projection writes it; binning and
/// blending read it.
struct alignas(64) Splat {
  float centre_x, centre_y;          // px
  float whitening_xx, whitening_xy;  // math::Whitening
  float whitening_yy, log2_opacity;
  float half_extent_x;  // px, of the ellipse alpha >= alpha_min
  float growth_px;      // px that its outline is widened by for listing
  float red, green, blue;
  float depth;  // world units along the view axis
  std::uint32_t original_index;
  std::uint16_t tile_x, tile_y, tile_end_x, tile_end_y;  // of the grid: its box, end exclusive
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

/// Projects and shades the Gaussians of one cluster. The visible ones go to the front of `splats`,
/// which has room for the whole cluster.
struct ProjectTask {
  const SceneStore* scene;
  const Camera* camera;
  const FramePlan* plan;  // what the lists have to cover
  // Defines which Gaussians are visible, and the tiles of a splat's box. vanilla: as in the
  // original; exact: where the ellipse is; catgs: where the trail is until the window's end.
  Pipeline pipeline;
  std::size_t cluster;
  Splat* splats;
  float min_depth;  // world units; nearer Gaussians do not count in ClusterSummary
  ClusterColours colours{nullptr, nullptr};
  // For catgs only.
  SplatPath* paths = nullptr;         // as splats
  ClusterMembers* members = nullptr;  // the visible ones
};

/// Projects and shades `members` of a cluster like project_cluster(), but without culling: the n-th
/// member is always splats[n].
struct RefreshTask {
  const SceneStore* scene;
  const Camera* camera;
  std::size_t cluster;
  const ClusterMembers* members;
  Splat* splats;          // without the fields that only listing needs
  std::uint32_t* depths;  // as splats: bits of depth
  float min_depth;
  ClusterColours colours;
};

struct ClusterSummary {
  std::uint32_t visible = 0;  // splats written
  // Over splats deeper than min_depth.
  std::uint32_t counted = 0;
  float nearest_depth = std::numeric_limits<float>::infinity();
  float inverse_depth_sum = 0.0f;
  float longest_path_px = 0.0f;
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
  glm::ivec2 first_px;  // of the grid
};

/// Pixels are blended in blocks of 4x4, which are culled as one: a register where that is wide
/// enough. A square is met by fewer splats than a row of as many pixels.
inline constexpr int block_side_px = 4;
inline constexpr int block_px = block_side_px * block_side_px;

/// First pixel of a block, inside of the image; the others may lie outside.
struct PixelBlock {
  std::uint16_t x, y;
};

/// The largest number of blocks that one task blends; a tile has half as many.
inline constexpr int max_task_blocks = 32;

struct BlendResult {
  std::uint64_t pairs = 0;    // (Gaussian, pixel) pairs blended, when counted
  std::size_t looked_at = 0;  // leading entries of the list that were looked at
  bool finished = false;      // no pixel would look at more entries
};

/// Blends a tile's list in some blocks and writes them to the image.
struct BlendTask {
  const Splat* splats;
  std::span<const DepthSlot> list;  // front to back
  std::span<const PixelBlock> blocks;
  glm::vec3 background;
  bool cull_blocks;  // skip blocks that a splat's ellipse misses; same image
  bool count_pairs;
  const HostImage* image;
};

/// The stages that are compiled once per instruction set.
struct SimdKernels {
  std::string_view name;
  ClusterSummary (*project_cluster)(const ProjectTask& task);
  ClusterSummary (*refresh_cluster)(const RefreshTask& task);
  void (*list_tiles)(const ListTask& task, std::vector<TileRun>& runs);  // appends
  BlendResult (*blend_blocks)(const BlendTask& task);
};

/// Kernels for instruction sets that this processor has, best first; the last is "SCALAR".
std::span<const SimdKernels> simd_kernels();

}  // namespace catgs

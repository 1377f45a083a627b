#pragma once

#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "render_core/camera.h"
#include "render_core/cpu/radix_sort.h"
#include "render_core/cpu/scene_store.h"
#include "render_core/host_image.h"
#include "render_core/renderer.h"

namespace catgs {

/// A visible Gaussian in the image plane: one cache line, written by projection and read by binning
/// and blending.
struct alignas(64) Splat {
  float centre_x, centre_y;          // px
  float whitening_xx, whitening_xy;  // math::Whitening
  float whitening_yy, log2_opacity;
  float half_extent_x, half_extent_y;  // px, of the box around alpha >= alpha_min
  float red, green, blue;
  float depth;  // world units along the view axis
  std::uint32_t original_index;
  std::uint16_t tile_x, tile_y, tile_end_x, tile_end_y;  // tiles its box touches, end exclusive
  float rightmost_y;  // px below the centre: where the ellipse alpha >= alpha_min is rightmost
};

/// Projects and shades the Gaussians of one cluster. The visible ones go to the front of `splats`,
/// which has room for the whole cluster; returns how many.
struct ProjectTask {
  const SceneStore* scene;
  const Camera* camera;
  Pipeline pipeline;
  std::size_t cluster;
  Splat* splats;
};

/// Neighbouring tiles of one row that list the same splat.
struct TileRun {
  std::uint16_t row, begin, end;  // tiles; end exclusive
  DepthSlot entry;
};

/// Blends one tile and writes its part of the image.
struct BlendTask {
  const Splat* splats;
  std::span<const DepthSlot> list;  // front to back
  glm::ivec2 tile;
  glm::vec3 background;
  bool cull_blocks;  // skip parts of rows that a splat's ellipse does not meet; same image
  bool count_pairs;  // else the result is 0
  const HostImage* image;
};

/// The stages that are compiled once per instruction set.
struct SimdKernels {
  std::string_view name;
  std::uint32_t (*project_cluster)(const ProjectTask& task);
  // Appends the runs of tiles that the splats' ellipses meet; slots count up from first_slot.
  void (*list_tiles)(std::span<const Splat> splats, std::uint32_t first_slot,
                     std::vector<TileRun>& runs);
  std::uint64_t (*blend_tile)(const BlendTask& task);  // (Gaussian, pixel) pairs blended
};

/// Kernels for instruction sets that this processor has, best first; the last is "SCALAR".
std::span<const SimdKernels> simd_kernels();

}  // namespace catgs

#pragma once

#include <cstdint>
#include <span>
#include <string_view>

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
  float reserved;
};

/// Projects and shades the Gaussians of one cluster. The visible ones go to the first free slots of
/// `splats` and `keys`, which have room for the whole cluster; returns how many.
struct ProjectTask {
  const SceneStore* scene;
  const Camera* camera;
  Pipeline pipeline;
  std::size_t cluster;
  Splat* splats;
  DepthSlot* keys;  // key: bits of the depth; value: first_slot + position in `splats`
  std::uint32_t first_slot;
};

/// Blends one tile and writes its part of the image.
struct BlendTask {
  const Splat* splats;
  std::span<const std::uint32_t> list;  // slots, front to back
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
  std::uint64_t (*blend_tile)(const BlendTask& task);  // (Gaussian, pixel) pairs blended
};

/// Kernels for instruction sets that this processor has, best first; the last is "SCALAR".
std::span<const SimdKernels> simd_kernels();

}  // namespace catgs

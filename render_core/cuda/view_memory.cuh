#pragma once

#include "render_core/cuda/blend.cuh"
#include "render_core/cuda/cull.cuh"
#include "render_core/cuda/device_scene.cuh"
#include "render_core/cuda/frame_arrays.cuh"
#include "render_core/cuda/memory_table.h"
#include "render_core/cuda/split.cuh"
#include "render_core/cuda/tile_sort.cuh"
#include "render_core/cuda/tiles.cuh"
#include "render_core/frame/renderer.h"

namespace catgs::cuda {

/// The sizes that the rows of ViewMemory depend on.
struct ViewSizes {
  FrameShape shape;
  SceneArrays scene;
  bool in_pages;  // the scene is
  ViewSettings settings;
  bool windows = false;  // groups have had windows

  [[nodiscard]] std::size_t pixels() const {
    return static_cast<std::size_t>(shape.width_px) * static_cast<std::size_t>(shape.height_px);
  }
  /// Number of parts of slices.
  [[nodiscard]] std::size_t slice_parts() const {
    return std::size_t{shape.slice_bound} * parts_per_tile;
  }
  [[nodiscard]] std::size_t slice_pixels() const {
    return std::size_t{shape.slice_bound} * tile_pixels;
  }
  [[nodiscard]] std::size_t part_limits() const {
    return occludes() ? std::size_t{shape.tiles()} * parts_per_tile : 0;
  }
  /// Whether frames hide what their predecessors did not show.
  [[nodiscard]] bool occludes() const { return settings.pipeline == Pipeline::catgs; }
  [[nodiscard]] bool makes_video() const { return settings.format == PixelFormat::i420; }
  [[nodiscard]] std::size_t scratch_bytes() const;
  /// Size of the picture in host memory.
  [[nodiscard]] std::size_t host_image_bytes() const;
};

/// Device memory of a View, and the page-locked host memory for its copies.
struct ViewMemory : MemoryTable<ViewSizes> {
  using S = const ViewSizes&;
  using U32 = std::uint32_t;

  // The frustum cache and the sort cache: the Gaussians in view, and the list of every tile.
  DeviceRow<U32> clusters{this, Life::group, [](S s) { return s.scene.frame_clusters; }};
  DeviceRow<float> share{this, Life::group,
                         [](S s) { return s.in_pages ? s.scene.cluster_count : 0; }};
  DeviceRow<U32> cull_mask{this, Life::group,
                           [](S s) { return cull_words(s.scene.frame_clusters); }};
  DeviceRow<U32> visible{this, Life::group, [](S s) { return s.shape.visible_bound; }};
  DeviceRow<uint2> range{this, Life::group, [](S s) { return s.shape.tiles(); }};
  DeviceRow<TileEntry> entries{this, Life::group, [](S s) { return s.shape.list_bound; }};
  DeviceRow<FrameCounts> counts{this, Life::group, [](S) { return 1; }};

  // For the Gaussians in view.
  DeviceRow<SplatRecord> records{this, Life::frame, [](S s) { return s.shape.visible_bound; }};
  DeviceRow<U32> depth{this, Life::frame, [](S s) { return s.shape.visible_bound; }};
  DeviceRow<float> splat_depth{this, Life::frame,
                               [](S s) { return s.occludes() ? s.shape.visible_bound : 0; }};

  // Used to make the lists. A sort may leave its result in a row or in its `other` one.
  DeviceRow<U32> cull_seen{this, Life::frame, [](S s) { return s.scene.frame_clusters; }};
  DeviceRow<U32> cull_before{this, Life::frame, [](S s) { return s.scene.frame_clusters; }};
  DeviceRow<TileSpans> spans{this, Life::frame, [](S s) { return s.shape.visible_bound; }};
  DeviceRow<SplatPath> path{this, Life::frame,
                            [](S s) { return s.windows ? s.shape.visible_bound : 0; }};
  DeviceRow<U32> tile_count{this, Life::frame, [](S s) { return s.shape.visible_bound; }};
  DeviceRow<U32> first{this, Life::frame, [](S s) { return s.shape.visible_bound; }};
  DeviceRow<U32> other_depth{this, Life::frame, [](S s) { return s.shape.visible_bound; }};
  DeviceRow<U32> order{this, Life::frame, [](S s) { return s.shape.visible_bound; }};
  DeviceRow<U32> other_order{this, Life::frame, [](S s) { return s.shape.visible_bound; }};
  DeviceRow<U32> tile{this, Life::frame, [](S s) { return s.shape.list_bound; }};
  DeviceRow<U32> other_tile{
      this, Life::frame, [](S s) { return sorts_in_one_pass(s.shape) ? 0 : s.shape.list_bound; }};
  DeviceRow<TileEntry> other_entries{this, Life::frame, [](S s) { return s.shape.list_bound; }};
  DeviceRow<U32> in_window{this, Life::frame, [](S s) { return window_tiles(s.shape); }};
  DeviceRow<std::byte> scratch{this, Life::frame, [](S s) { return s.scratch_bytes(); }};
  PinnedRow<HostCounts> list_counts{this, Life::frame, [](S) { return 1; }};

  // Where the parts of the last frame ended, and what follows from that: see Occlusion.
  DeviceRow<float> part_ends{this, Life::view, [](S s) { return s.part_limits(); }};
  DeviceRow<float> part_limit{this, Life::frame, [](S s) { return s.part_limits(); }};
  DeviceRow<float2> tile_limit{this, Life::frame,
                               [](S s) { return s.occludes() ? s.shape.tiles() : 0; }};

  // Tasks of the blend.
  DeviceRow<U32> reach{this, Life::view, [](S s) { return s.shape.tiles(); }};
  DeviceRow<U32> last_reach{this, Life::view, [](S s) { return s.shape.tiles(); }};
  DeviceRow<BlendTask> tasks{this, Life::frame, [](S s) { return task_bound(s.shape); }};
  DeviceRow<U32> queue{this, Life::frame, [](S s) { return queue_bound(s.shape); }};
  DeviceRow<uint2> tile_slices{this, Life::frame, [](S s) { return s.shape.tiles(); }};
  DeviceRow<U32> consumed{this, Life::frame, [](S s) { return s.slice_parts(); }};
  DeviceRow<float> slice_transmittance{this, Life::frame, [](S s) { return s.slice_parts(); }};
  DeviceRow<float4> slice_pixels{this, Life::frame, [](S s) { return s.slice_pixels(); }};

  // The picture, and the frame's counts for the host.
  DeviceRow<float> rgb{this, Life::frame, [](S s) { return 3 * s.pixels(); }};
  DeviceRow<std::uint8_t> i420{this, Life::frame,
                               [](S s) { return s.makes_video() ? s.host_image_bytes() : 0; }};
  PinnedRow<std::byte> host_image{this, Life::frame, [](S s) { return s.host_image_bytes(); }};
  PinnedRow<FrameCounts> host_counts{this, Life::view, [](S) { return 1; }};

  /// Whether lists of this shape fit in the present memory.
  [[nodiscard]] bool holds_lists(const FrameShape& shape) const {
    return shape.visible_bound <= visible.size() && shape.tiles() <= range.size() &&
           shape.list_bound <= entries.size();
  }
};

}  // namespace catgs::cuda

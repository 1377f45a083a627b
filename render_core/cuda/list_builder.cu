#include <algorithm>
#include <limits>
#include <utility>

#include <glm/geometric.hpp>

#include "render_core/cuda/bin.cuh"
#include "render_core/cuda/cuda_check.h"
#include "render_core/cuda/cull.cuh"
#include "render_core/cuda/list_builder.cuh"
#include "render_core/cuda/project.cuh"
#include "render_core/cuda/tile_sort.cuh"

namespace catgs::cuda {
namespace {

/// Whether tile indices and shape.tiles(), which stands for no tile, fit in 16 bits.
bool is_narrow(const FrameShape& shape) {
  return shape.tiles() <= std::numeric_limits<std::uint16_t>::max();
}

}  // namespace

ListSlack list_slack(const Camera& camera, const FramePlan& plan) {
  // A forecast of constant velocity is wrong by so much of the way, as recorded heads show.
  constexpr float wrong_share = 0.15f, far_px = 2.0f, most_px = 16.0f;
  const float way =
      glm::distance(camera.world_from_camera.position, plan.window_end.world_from_camera.position);
  return {.far_px = far_px, .near_px = wrong_share * way * camera.focal_px.x, .most_px = most_px};
}

ListRequest::ListRequest(const Camera& camera, const FramePlan& plan,
                         const SpeculationSettings& settings, std::optional<glm::ivec2> corner_px)
    : cameras{.now = in_grid(make_camera_pair(camera), corner_px.value_or(glm::ivec2(0))),
              .end = {},
              .near_z = camera.near_z},
      culler(camera, plan, corner_px && plan.window > 0 ? grid_margin_px : 0),
      sweeps(plan.window > 0),
      min_depth(speculation_min_depth(settings, camera.near_z)) {
  cameras.end = cameras.now.single;
  if (!sweeps) return;
  const glm::ivec2 end_px = corner_px.value_or(glm::ivec2(0)) - plan.end_shift_px;
  cameras.end = in_grid(make_camera_pair(plan.window_end), end_px).single;
  if (corner_px) slack = list_slack(camera, plan);
}

SortScratch ListBuilder::scratch() const {
  return {.memory = memory_.scratch.get(), .bytes = memory_.scratch.bytes()};
}

void ListBuilder::cull(const ListRequest& request, const FrameShape& shape, cudaStream_t stream) {
  const ViewMemory& m = memory_;
  check(cudaMemsetAsync(m.counts.get(), 0, sizeof(FrameCounts), stream), "counts");
  *m.list_counts.get() = {};
  launch_cull({.scene = request.scene,
               .cut = request.cut,
               .culler = request.culler,
               .camera = request.cameras,
               .sweeps = request.sweeps,
               .occlusion = request.occlusion,
               .shape = shape,
               .clusters = m.clusters.get(),
               .mask = m.cull_mask.get(),
               .seen = m.cull_seen.get(),
               .before = m.cull_before.get(),
               .visible = m.visible.get(),
               .counts = m.counts.get(),
               .host_counts = m.list_counts.get(),
               .scratch = scratch(),
               .processors = processors_},
              stream);
  check(cudaEventRecord(counted_.get(), stream), "visible Gaussians");
}

void ListBuilder::project(const ListRequest& request, const FrameShape& shape,
                          cudaStream_t stream) {
  const ViewMemory& m = memory_;
  launch_project({.scene = request.scene,
                  .camera = request.cameras,
                  .shape = shape,
                  .min_depth = request.min_depth,
                  .counts = m.counts.get(),
                  .visible = m.visible.get(),
                  .records = m.records.get(),
                  .depth_key = m.depth.get(),
                  .splat_depth = m.splat_depth.get(),
                  .tile_count = m.tile_count.get(),
                  .spans = m.spans.get(),
                  .path = request.sweeps ? m.path.get() : nullptr,
                  .slack = request.slack,
                  .order = m.order.get(),
                  .host_counts = nullptr},
                 request.sweeps ? Listing::trails : Listing::ellipses, stream);
}

void ListBuilder::sort_by_depth(const FrameShape& shape, cudaStream_t stream) {
  const ViewMemory& m = memory_;
  check(cudaEventSynchronize(counted_.get()), "visible Gaussians");
  visible_ = std::min(m.list_counts.get()->visible, shape.visible_bound);
  PingPong<std::uint32_t> depth{.current = m.depth.get(), .other = m.other_depth.get()};
  PingPong<std::uint32_t> order{.current = m.order.get(), .other = m.other_order.get()};
  cuda::sort_by_depth(visible_, depth, order, scratch(), stream);
  order_ = order.current;
}

void ListBuilder::emit(const ListRequest& request, const FrameShape& shape, cudaStream_t stream) {
  if (is_narrow(shape)) {
    emit_as<std::uint16_t>(request, shape, stream);
  } else {
    emit_as<std::uint32_t>(request, shape, stream);
  }
}

template <class Tile>
void ListBuilder::emit_as(const ListRequest& request, const FrameShape& shape,
                          cudaStream_t stream) {
  const ViewMemory& m = memory_;
  scan_tile_counts(visible_, m.counts.get(), m.list_counts.get(), order_, m.tile_count.get(),
                   m.first.get(), scratch(), stream);
  check(cudaEventRecord(counted_.get(), stream), "list entries");
  launch_emit<Tile>({.shape = shape,
                     .counts = m.counts.get(),
                     .records = m.records.get(),
                     .order = order_,
                     .first = m.first.get(),
                     .tile_count = m.tile_count.get(),
                     .spans = m.spans.get(),
                     .path = request.sweeps ? m.path.get() : nullptr,
                     .slack = request.slack,
                     .occlusion = request.occlusion,
                     .splat_depth = m.splat_depth.get(),
                     .in_window = sorts_in_one_pass(shape) ? m.in_window.get() : nullptr,
                     .tile = reinterpret_cast<Tile*>(m.tile.get()),
                     .entry = m.other_entries.get()},
                    stream);
}

void ListBuilder::sort_by_tile(const FrameShape& shape, cudaStream_t stream) {
  const ViewMemory& m = memory_;
  if (sorts_in_one_pass(shape)) {
    launch_tile_sort({.shape = shape,
                      .counts = m.counts.get(),
                      .tile = reinterpret_cast<const std::uint16_t*>(m.tile.get()),
                      .unsorted = m.other_entries.get(),
                      .in_window = m.in_window.get(),
                      .entry = m.entries.get(),
                      .range = m.range.get()},
                     stream);
  } else if (is_narrow(shape)) {
    sort_as<std::uint16_t>(shape, stream);
  } else {
    sort_as<std::uint32_t>(shape, stream);
  }
}

template <class Tile>
void ListBuilder::sort_as(const FrameShape& shape, cudaStream_t stream) {
  ViewMemory& m = memory_;
  PingPong<Tile> tile{.current = reinterpret_cast<Tile*>(m.tile.get()),
                      .other = reinterpret_cast<Tile*>(m.other_tile.get())};
  PingPong<TileEntry> entry{.current = m.other_entries.get(), .other = m.entries.get()};
  check(cudaEventSynchronize(counted_.get()), "list entries");
  const std::uint32_t entries = std::min(m.list_counts.get()->list_entries, shape.list_bound);
  cuda::sort_by_tile(shape, entries, tile, entry, scratch(), stream);
  launch_ranges<Tile>(
      {.shape = shape, .entries = entries, .tile = tile.current, .range = m.range.get()}, stream);
  if (entry.current == m.other_entries.get()) m.entries.swap(m.other_entries);
}

}  // namespace catgs::cuda

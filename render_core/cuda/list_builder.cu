#include <algorithm>
#include <limits>
#include <utility>

#include "render_core/cuda/bin.cuh"
#include "render_core/cuda/cuda_check.h"
#include "render_core/cuda/cull.cuh"
#include "render_core/cuda/list_builder.cuh"
#include "render_core/cuda/project.cuh"

namespace catgs::cuda {
namespace {

/// Whether tile indices and shape.tiles(), which is none's, fit in 16 bits.
bool is_narrow(const FrameShape& shape) {
  return shape.tiles() <= std::numeric_limits<std::uint16_t>::max();
}

}  // namespace

void TileLists::reserve(const FrameShape& shape_to_hold, const SceneArrays& scene) {
  clusters.reserve(scene.cluster_count);
  cull_mask.reserve(cull_words(scene.cluster_count));
  visible.reserve(shape_to_hold.visible_bound);
  range.reserve(shape_to_hold.tile_bound);
  slot.reserve(shape_to_hold.list_bound);
  counts.reserve(1);
}

bool TileLists::has_room(const FrameShape& wanted) const {
  return wanted.visible_bound <= visible.size() && wanted.tile_bound <= range.size() &&
         wanted.list_bound <= slot.size();
}

std::size_t TileLists::bytes() const {
  return clusters.bytes() + cull_mask.bytes() + visible.bytes() + range.bytes() + slot.bytes() +
         counts.bytes();
}

ListRequest::ListRequest(const Camera& camera, const FramePlan& plan,
                         const SpeculationSettings& settings)
    : cameras{make_camera_pair(camera), {}, camera.near_z},
      culler(camera, plan),
      sweeps(plan.window > 0),
      min_depth(speculation_min_depth(settings, camera.near_z)) {
  cameras.now.single.near_z = plan.list_near_z;
  cameras.end = sweeps ? make_camera_pair(plan.window_end).single : cameras.now.single;
  cameras.growth = math::convert<float>(plan.growth);
  cameras.trail_shift_px = make_float2(static_cast<float>(plan.trail_shift_px.x),
                                       static_cast<float>(plan.trail_shift_px.y));
}

void ListBuilder::reserve(const FrameShape& shape, bool sweeps) {
  Memory& m = memory_;
  m.cull_seen.reserve(scene_.cluster_count);
  m.cull_before.reserve(scene_.cluster_count);
  m.records.reserve(shape.visible_bound);
  m.spans.reserve(shape.visible_bound);
  if (sweeps) m.path.reserve(shape.visible_bound);
  m.tile_count.reserve(shape.visible_bound);
  m.first.reserve(shape.visible_bound);
  for (int i = 0; i < 2; ++i) {
    m.depth[i].reserve(shape.visible_bound);
    m.order[i].reserve(shape.visible_bound);
    m.tile[i].reserve(shape.list_bound);
  }
  m.slot.reserve(shape.list_bound);
  m.scratch.reserve(std::max(sort_scratch_bytes(shape), cull_scratch_bytes(scene_.cluster_count)));
  m.counts.reserve(1);
}

std::size_t ListBuilder::bytes() const {
  const Memory& m = memory_;
  return m.cull_seen.bytes() + m.cull_before.bytes() + m.records.bytes() + m.spans.bytes() +
         m.path.bytes() + m.tile_count.bytes() + m.first.bytes() + m.depth[0].bytes() +
         m.depth[1].bytes() + m.order[0].bytes() + m.order[1].bytes() + m.tile[0].bytes() +
         m.tile[1].bytes() + m.slot.bytes() + m.scratch.bytes();
}

SortScratch ListBuilder::scratch() const {
  return {memory_.scratch.get(), memory_.scratch.bytes()};
}

void ListBuilder::cull(const ListRequest& request, TileLists& lists, cudaStream_t stream) {
  check(cudaMemsetAsync(lists.counts.get(), 0, sizeof(FrameCounts), stream), "counts");
  *memory_.counts.get() = {};
  launch_cull(
      {scene_, request.culler, request.cameras, request.sweeps, lists.shape, lists.clusters.get(),
       lists.cull_mask.get(), memory_.cull_seen.get(), memory_.cull_before.get(),
       lists.visible.get(), lists.counts.get(), memory_.counts.get(), scratch(), processors_},
      stream);
  check(cudaEventRecord(counted_.get(), stream), "visible Gaussians");
}

void ListBuilder::project(const ListRequest& request, TileLists& lists, const ColourArrays& colours,
                          cudaStream_t stream) {
  const Memory& m = memory_;
  launch_project(
      {scene_, request.cameras, lists.shape, request.min_depth, lists.counts.get(),
       lists.visible.get(), colours, m.records.get(), m.depth[0].get(), m.tile_count.get(),
       m.spans.get(), request.sweeps ? m.path.get() : nullptr, m.order[0].get()},
      request.sweeps ? Listing::trails : Listing::ellipses, stream);
}

void ListBuilder::sort_by_depth(const TileLists& lists, cudaStream_t stream) {
  const Memory& m = memory_;
  check(cudaEventSynchronize(counted_.get()), "visible Gaussians");
  visible_ = std::min(m.counts.get()->visible, lists.shape.visible_bound);
  PingPong<std::uint32_t> depth{m.depth[0].get(), m.depth[1].get()};
  PingPong<std::uint32_t> order{m.order[0].get(), m.order[1].get()};
  cuda::sort_by_depth(visible_, depth, order, scratch(), stream);
  order_ = order.current;
}

void ListBuilder::emit(const ListRequest& request, TileLists& lists, cudaStream_t stream) {
  if (is_narrow(lists.shape)) {
    emit_as<std::uint16_t>(request, lists, stream);
  } else {
    emit_as<std::uint32_t>(request, lists, stream);
  }
}

template <class Tile>
void ListBuilder::emit_as(const ListRequest& request, TileLists& lists, cudaStream_t stream) {
  const Memory& m = memory_;
  scan_tile_counts(visible_, lists.counts.get(), m.counts.get(), order_, m.tile_count.get(),
                   m.first.get(), scratch(), stream);
  check(cudaEventRecord(counted_.get(), stream), "list entries");
  launch_emit<Tile>({lists.shape, lists.counts.get(), m.records.get(), order_, m.first.get(),
                     m.tile_count.get(), m.spans.get(), request.sweeps ? m.path.get() : nullptr,
                     reinterpret_cast<Tile*>(m.tile[0].get()), m.slot.get()},
                    stream);
}

void ListBuilder::sort_by_tile(TileLists& lists, cudaStream_t stream) {
  if (is_narrow(lists.shape)) {
    sort_as<std::uint16_t>(lists, stream);
  } else {
    sort_as<std::uint32_t>(lists, stream);
  }
}

template <class Tile>
void ListBuilder::sort_as(TileLists& lists, cudaStream_t stream) {
  Memory& m = memory_;
  PingPong<Tile> tile{reinterpret_cast<Tile*>(m.tile[0].get()),
                      reinterpret_cast<Tile*>(m.tile[1].get())};
  PingPong<std::uint32_t> slot{m.slot.get(), lists.slot.get()};
  check(cudaEventSynchronize(counted_.get()), "list entries");
  const std::uint32_t entries = std::min(m.counts.get()->list_entries, lists.shape.list_bound);
  cuda::sort_by_tile(lists.shape, entries, tile, slot, scratch(), stream);
  launch_ranges<Tile>({lists.shape, entries, tile.current, lists.range.get()}, stream);
  if (slot.current == m.slot.get()) std::swap(m.slot, lists.slot);
}

}  // namespace catgs::cuda

#include <algorithm>
#include <cstddef>
#include <utility>

#include "render_core/cuda/blend.cuh"
#include "render_core/cuda/convert.cuh"
#include "render_core/cuda/cuda_view.cuh"
#include "render_core/cuda/frame_output.cuh"
#include "render_core/cuda/group_grid.h"
#include "render_core/cuda/occlusion.cuh"
#include "render_core/cuda/split.cuh"

namespace catgs::cuda {

namespace {

int processors_of(int device) {
  int processors = 0;
  check(cudaDeviceGetAttribute(&processors, cudaDevAttrMultiProcessorCount, device), "device");
  return processors;
}

/// The most Gaussians that a frame may look at.
std::uint32_t most_gaussians(const SceneArrays& scene) {
  return std::min(scene.count, scene.frame_clusters * std::uint32_t{cluster_size});
}

glm::ivec2 corner_of(const FrameShape& shape) { return {shape.left_px, shape.top_px}; }

Finish finish_of(Pipeline pipeline) {
  if (pipeline == Pipeline::catgs)
    return {.transmittance = static_cast<float>(least_shown), .fills = true};
  return {.transmittance = static_cast<float>(transmittance_min), .fills = false};
}

}  // namespace

CudaView::CudaView(std::shared_ptr<const DeviceScene> scene, int device,
                   const ViewSettings& settings)
    : scene_(std::move(scene)),
      device_(device),
      processors_(processors_of(device)),
      settings_(settings),
      driver_(settings_, FrameDriver::CatgsWindows::some),
      room_(most_gaussians(scene_->arrays()), settings.max_list_entries, settings.split_tasks),
      builder_(memory_, processors_),
      sub_frames_(memory_, settings.pipeline == Pipeline::catgs),
      blend_warps_(blend_warps(processors_)) {
  if (scene_->tree() != nullptr) paged_.emplace(*scene_->tree(), settings);
  // The memory that does not depend on the image is the largest part of a small scene's View. A
  // device without room for it should say so while another can be chosen. For a large scene, only
  // the first frame tells how much is in view.
  if (settings.pipeline == Pipeline::vanilla) return;
  set_shape(glm::ivec2(tile_side_px), {}, tile_side_px);
  reserve(Headroom::none);
  shape_ = {};
}

RenderStatus CudaView::render(const FrameRequest& request, FrameView& frame) noexcept {
  return driver_.render(
      request, frame, [&](const FramePlan& plan) { return draw(request, plan); },
      [&] { forget_frames(); });
}

std::optional<FrameView> CudaView::draw(const FrameRequest& request, const FramePlan& plan) {
  check(cudaSetDevice(device_), "device");
  if (settings_.pipeline == Pipeline::vanilla) {
    draw_vanilla(request);
  } else if (plan.kind == FrameKind::key) {
    draw_key(request, plan);
  } else if (!draw_sub(request, plan)) {
    return std::nullopt;
  }
  return finished(plan.kind, request.camera.near_z);
}

/// Called after a failure. Buffers that could not grow are gone, and the data that frames shared
/// with them.
void CudaView::forget_frames() {
  shape_ = {};
  reach_of_.reset();
  ends_of_.reset();
}

void CudaView::set_shape(glm::ivec2 size_px, const FramePlan& plan, int tile_side) {
  if (shape_.width_px != size_px.x || shape_.height_px != size_px.y) forget_frames();
  set_grid(shape_, size_px, plan, tile_side, sub_frames_.follows() ? grid_margin_px : 0);
  const FrameSizes room = room_.sizes();
  shape_.visible_bound = room.visible;
  shape_.list_bound = room.list_entries;
  shape_.slice_bound = std::min(room.slices, most_slices(shape_));
}

/// Reserves memory for the frame's shape. Where lists need more memory, `headroom` adds some, so
/// that they do not need more again and again. Throws CudaError.
void CudaView::reserve(Headroom headroom) {
  FrameShape roomy =
      sub_frames_.follows() && sub_frames_.wants_room() ? with_largest_grid(shape_) : shape_;
  if (headroom == Headroom::some && !memory_.holds_lists(shape_)) {
    const FrameSizes most = room_.limits();
    roomy.visible_bound = std::min(most.visible, shape_.visible_bound + shape_.visible_bound / 4);
    roomy.list_bound = std::min(most.list_entries, shape_.list_bound + shape_.list_bound / 4);
  }
  if (memory_.reserve({.shape = roomy,
                       .scene = scene_->arrays(),
                       .in_pages = paged_.has_value(),
                       .settings = settings_,
                       .windows = sub_frames_.wants_room()})) {
    reach_of_.reset();
    ends_of_.reset();
  }
}

/// Sets the frame's shape and makes room for it. Where the device has too little memory, it first
/// gives up the headroom, then slices, then the farther part of the lists.
void CudaView::make_room(glm::ivec2 size_px, const FramePlan& plan) {
  const FrameRoom wanted = room_;
  sub_frames_.want_room(plan);
  Headroom headroom = Headroom::some;
  for (;;) {
    set_shape(size_px, plan, tile_side_px);
    try {
      reserve(headroom);
      return;
    } catch (const CudaError& error) {
      memory_.release();
      reach_of_.reset();
      ends_of_.reset();
      const bool short_of_memory = error.status_code() == RenderStatus::Code::out_of_memory;
      const bool had_headroom = std::exchange(headroom, Headroom::none) == Headroom::some;
      if (short_of_memory && (had_headroom || room_.retreat())) continue;
      room_ = wanted;
      throw;
    }
  }
}

/// Called after a key frame: whether it lacked room, and has more now.
bool CudaView::needs_more_room() {
  const FrameCounts& counts = *memory_.host_counts.get();
  return room_.outgrown_by(
      {counts.visible, counts.list_entries, std::min(counts.wanted_slices, most_slices(shape_))});
}

void CudaView::draw_key(const FrameRequest& request, const FramePlan& plan) {
  if (paged_) paged_->begin(request, plan);
  for (;;) {
    make_room(request.camera.size_px, plan);
    ListRequest listed(request.camera, plan, settings_.speculation,
                       sub_frames_.follows() ? std::optional(corner_of(shape_)) : std::nullopt);
    times_.begin(stream_.get());
    listed.scene = scene_arrays();
    if (paged_) listed.cut = cut_tree(request, plan);
    listed.occlusion = want_occlusion(listed, plan);
    sub_frames_.begin_group(plan, shape_, listed.slack);
    list_tiles(listed);
    split(FrameKind::key);
    times_.end(Stage::sort, stream_.get());
    blend(request);
    deliver();
    if (!needs_more_room()) break;
    ends_of_.reset();  // this drawing has replaced the last frame's ends
  }
  note_ends(request.camera);
}

/// The ends of parts are those of the frame that was drawn.
void CudaView::note_ends(const Camera& camera) {
  if (sub_frames_.follows())
    ends_of_ = {.camera = in_grid(make_camera_pair(camera), corner_of(shape_)).single,
                .shape = shape_};
}

/// The scene, and the part of each cluster that is drawn.
SceneArrays CudaView::scene_arrays() const {
  SceneArrays scene = scene_->arrays();
  if (paged_) scene.share = memory_.share.get();
  return scene;
}

/// The cut of a scene in pages for the frame that paged_ has begun.
TreeCut CudaView::cut_tree(const FrameRequest& request, const FramePlan& plan) {
  return {.tree = scene_->tree(paged_->table()),
          .now = CutEye(request.camera),
          .end = CutEye(plan.window > 0 ? plan.window_end : request.camera),
          .detail_px = request.detail_px,
          .now_s = paged_->now_s(),
          .share = memory_.share.get()};
}

/// Finds what the last frame shows to be hidden in this one, or in all of its window.
Occlusion CudaView::want_occlusion(const ListRequest& listed, const FramePlan& plan) {
  const ViewMemory& m = memory_;
  if (!ends_of_) return {};
  const auto radius_from = [&](const math::CameraModel<float>& camera) {
    return math::occlusion_radius<float>(camera, ends_of_->camera, mean_inverse_depth_,
                                         part_side_px);
  };
  const auto &now = listed.cameras.now.single, &end = listed.cameras.end;
  const int at_start = radius_from(now), at_end = radius_from(end);
  if (at_start < 0 || at_end < 0) return {};
  launch_occlusion({.shape = shape_,
                    .now = now,
                    .end = end,
                    .sweeps = listed.sweeps,
                    .shown = box_of_pictures(shape_, plan, listed.sweeps ? grid_margin_px : 0),
                    .last = *ends_of_,
                    .radius = std::max(at_start, at_end),
                    .last_ends = m.part_ends.get(),
                    .part = m.part_limit.get(),
                    .tile = m.tile_limit.get()},
                   stream_.get());
  return {.part = m.part_limit.get(), .tile = m.tile_limit.get()};
}

/// Stages project, bin and most of sort of a key frame.
void CudaView::list_tiles(const ListRequest& request) {
  const cudaStream_t stream = stream_.get();
  builder_.cull(request, shape_, stream);
  builder_.project(request, shape_, stream);
  times_.end(Stage::project, stream);
  builder_.sort_by_depth(shape_, stream);
  times_.end_depth_sort(stream);
  builder_.emit(request, shape_, stream);
  times_.end(Stage::bin, stream);
  builder_.sort_by_tile(shape_, stream);
}

/// Draws from the lists of the group. False where they do not hold.
bool CudaView::draw_sub(const FrameRequest& request, const FramePlan& plan) {
  const cudaStream_t stream = stream_.get();
  sub_frames_.place(plan, shape_);
  times_.begin(stream);
  sub_frames_.project(scene_arrays(), request.camera, shape_,
                      speculation_min_depth(settings_.speculation, request.camera.near_z), stream);
  times_.end(Stage::project, stream);
  times_.end(Stage::bin, stream);
  if (!sub_frames_.lists_hold(shape_, reach_of_.has_value(), stream)) return false;
  split(FrameKind::sub);
  times_.end(Stage::sort, stream);
  blend(request);
  deliver();
  note_ends(request.camera);
  return true;
}

void CudaView::draw_vanilla(const FrameRequest& request) {
  const glm::vec3& b = request.background;
  const ViewMemory& m = memory_;
  const FrameShape picture{.width_px = request.camera.size_px.x,
                           .height_px = request.camera.size_px.y};
  (void)memory_.reserve({.shape = picture, .scene = {}, .in_pages = false, .settings = settings_});
  set_shape(request.camera.size_px, {}, tile_size_px);
  shape_.list_bound = static_cast<std::uint32_t>(
      std::min<std::uint64_t>(settings_.max_list_entries, list_entries_limit));
  const cudaStream_t stream = stream_.get();
  times_.begin(stream);
  check(cudaMemsetAsync(m.counts.get(), 0, sizeof(FrameCounts), stream), "counts");
  vanilla_.draw(
      {.scene = &scene_->arrays(),
       .camera = make_camera_pair(request.camera),
       .shape = shape_,
       .background = make_float3(b.x, b.y, b.z),
       .rgb = m.rgb.get(),
       .counts = m.counts.get(),
       .count_pairs = settings_.count_pairs},
      [this](Stage stage) { times_.end(stage, stream_.get()); }, stream);
  deliver();
}

/// Cuts the tiles into tasks.
void CudaView::split(FrameKind kind) {
  ViewMemory& m = memory_;
  m.reach.swap(m.last_reach);
  LastReach last;
  // The mean that the last frame expected; 0: unknown.
  std::uint32_t mean = 0;
  if (reach_of_) {
    const auto expected = m.host_counts.get()->expected_entries;
    if (expected > 0)
      mean = std::max(1u, static_cast<std::uint32_t>(expected / reach_of_->tiles()));
    last = {
        .reach = m.last_reach.get(), .tiles_x = reach_of_->tiles_x, .tiles_y = reach_of_->tiles_y};
    // The grid of a sub-frame is that of the last frame, though its picture lies elsewhere in it.
    if (kind == FrameKind::key)
      last.from_px =
          make_int2(reach_of_->left_px - shape_.left_px, reach_of_->top_px - shape_.top_px);
  }
  launch_split({.shape = shape_,
                .range = m.range.get(),
                .last_reach = last,
                .reach = m.reach.get(),
                .tasks = m.tasks.get(),
                .tile_slices = m.tile_slices.get(),
                .queue = m.queue.get(),
                .slice_transmittance = m.slice_transmittance.get(),
                .counts = m.counts.get(),
                .mean_list = mean,
                .split = settings_.split_tasks},
               stream_.get());
  reach_of_ = shape_;
}

void CudaView::blend(const FrameRequest& request) {
  const ViewMemory& m = memory_;
  const cudaStream_t stream = stream_.get();
  const float3 background =
      make_float3(request.background.x, request.background.y, request.background.z);
  const PartEnds ends{.splat_depth = m.splat_depth.get(), .depth = m.part_ends.get()};
  launch_blend({.shape = shape_,
                .records = m.records.get(),
                .entries = m.entries.get(),
                .tasks = m.tasks.get(),
                .queue = m.queue.get(),
                .background = background,
                .rgb = m.rgb.get(),
                .slice_pixels = m.slice_pixels.get(),
                .consumed = m.consumed.get(),
                .slice_transmittance = m.slice_transmittance.get(),
                .ends = ends,
                .finish = finish_of(settings_.pipeline),
                .reach = m.reach.get(),
                .counts = m.counts.get(),
                .loose = sub_frames_.loose(),
                .count_pairs = settings_.count_pairs,
                .warps = blend_warps_},
               stream);
  launch_composite({.shape = shape_,
                    .tasks = m.tasks.get(),
                    .tile_slices = m.tile_slices.get(),
                    .slice_pixels = m.slice_pixels.get(),
                    .consumed = m.consumed.get(),
                    .entries = m.entries.get(),
                    .ends = ends,
                    .loose = sub_frames_.loose(),
                    .finish = finish_of(settings_.pipeline),
                    .background = background,
                    .rgb = m.rgb.get(),
                    .reach = m.reach.get()},
                   stream);
  depths_.find({.shape = shape_,
                .range = m.range.get(),
                .entries = m.entries.get(),
                .records = m.records.get(),
                .splat_depth = m.splat_depth.get()},
               settings_.pipeline == Pipeline::catgs ? request.depth_cells : glm::ivec2(0), stream);
  times_.end(Stage::blend, stream_.get());
}

/// Moves the picture where the View's settings want it, and waits for the frame.
void CudaView::deliver() {
  const ViewMemory& m = memory_;
  const cudaStream_t stream = stream_.get();
  const std::size_t pixels = static_cast<std::size_t>(shape_.width_px) * shape_.height_px;
  if (settings_.format == PixelFormat::i420) {
    launch_convert({.width_px = shape_.width_px,
                    .height_px = shape_.height_px,
                    .rgb = m.rgb.get(),
                    .luma = m.i420.get(),
                    .cb = m.i420.get() + pixels,
                    .cr = m.i420.get() + pixels + pixels / 4},
                   stream);
    check(cudaMemcpyAsync(m.host_image.get(), m.i420.get(), pixels + pixels / 2,
                          cudaMemcpyDeviceToHost, stream),
          "image copy");
  } else if (settings_.space == MemorySpace::host) {
    check(cudaMemcpyAsync(m.host_image.get(), m.rgb.get(), 3 * sizeof(float) * pixels,
                          cudaMemcpyDeviceToHost, stream),
          "image copy");
  }
  check(cudaMemcpyAsync(m.host_counts.get(), m.counts.get(), sizeof(FrameCounts),
                        cudaMemcpyDeviceToHost, stream),
        "counts");
  times_.end(Stage::convert, stream_.get());
  // Pictures for an encoder belong to servers, whose processors have other work while a GPU draws.
  // For other pictures the host polls, which answers sooner.
  if (settings_.format == PixelFormat::i420) {
    check(cudaEventRecord(delivered_.get(), stream), "frame");
    check(cudaEventSynchronize(delivered_.get()), "frame");
  } else {
    check(cudaStreamSynchronize(stream), "frame");
  }
}

std::size_t CudaView::memory_bytes() const {
  return memory_.bytes() + vanilla_.bytes() + depths_.bytes();
}

std::vector<std::uint32_t> CudaView::tile_loads() const {
  const uint2* ranges =
      settings_.pipeline == Pipeline::vanilla ? vanilla_.ranges() : memory_.range.get();
  if (ranges == nullptr) return {};
  check(cudaSetDevice(device_), "device");
  return cuda::tile_loads(shape_, ranges);
}

FrameView CudaView::finished(FrameKind kind, float near_z) {
  FrameView frame = borrowed_frame(settings_, shape_, memory_.host_image.get(), memory_.rgb.get());
  frame.depths = depths_.grid();
  frame.stats = frame_stats(*memory_.host_counts.get(), shape_, kind, near_z);
  if (paged_) paged_->end(frame.stats);
  mean_inverse_depth_ = frame.stats.mean_inverse_depth;
  times_.read(settings_.pipeline != Pipeline::vanilla && kind == FrameKind::key,
              frame.stats.stage_ms);
  return frame;
}

}  // namespace catgs::cuda

#include <algorithm>
#include <cstddef>
#include <utility>

#include "render_core/cuda/blend.cuh"
#include "render_core/cuda/convert.cuh"
#include "render_core/cuda/cuda_view.cuh"
#include "render_core/cuda/frame_output.cuh"
#include "render_core/cuda/occlusion.cuh"
#include "render_core/cuda/project.cuh"
#include "render_core/cuda/split.cuh"

namespace catgs::cuda {

namespace {

int processors_of(int device) {
  int processors = 0;
  check(cudaDeviceGetAttribute(&processors, cudaDevAttrMultiProcessorCount, device), "device");
  return processors;
}

/// Sets the tiles of a picture.
void set_tiles(FrameShape& shape, glm::ivec2 size_px, int tile_side) {
  const glm::ivec2 tiles = (size_px + (tile_side - 1)) / tile_side;
  shape.width_px = size_px.x;
  shape.height_px = size_px.y;
  shape.tiles_x = tiles.x;
  shape.tiles_y = tiles.y;
}

/// The most Gaussians that a frame may look at.
std::uint32_t most_gaussians(const SceneArrays& scene) {
  return std::min(scene.count, scene.frame_clusters * std::uint32_t{cluster_size});
}

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
      driver_(settings_),
      room_(most_gaussians(scene_->arrays()), settings.max_list_entries, settings.split_tasks),
      builder_(memory_, processors_),
      blend_warps_(blend_warps(processors_)) {
  if (scene_->tree() != nullptr) paged_.emplace(*scene_->tree(), settings);
  // The memory that does not depend on the image is the largest part of a small scene's View. A
  // device without room for it should say so while another can be chosen. For a large scene, only
  // the first frame tells how much is in view.
  if (settings.pipeline == Pipeline::vanilla) return;
  set_shape(glm::ivec2(tile_side_px), tile_side_px);
  reserve(Headroom::none);
  shape_ = {};
}

RenderStatus CudaView::render(const FrameRequest& request, FrameView& frame) noexcept {
  return driver_.render(
      request, frame, [&](const FramePlan& plan) { return draw(request, plan); },
      [&] { forget_frames(); });
}

FrameView CudaView::draw(const FrameRequest& request, const FramePlan& plan) {
  check(cudaSetDevice(device_), "device");
  if (settings_.pipeline == Pipeline::vanilla) {
    draw_vanilla(request);
  } else if (plan.kind == FrameKind::key) {
    draw_key(request, plan);
  } else {
    draw_sub(request);
  }
  return finished(plan.kind, request.camera.near_z);
}

/// Called after a failure. Buffers that could not grow are gone, and the data that frames shared
/// with them.
void CudaView::forget_frames() {
  shape_ = {};
  reach_known_ = false;
  ends_of_.reset();
}

void CudaView::set_shape(glm::ivec2 size_px, int tile_side) {
  if (shape_.width_px != size_px.x || shape_.height_px != size_px.y) forget_frames();
  set_tiles(shape_, size_px, tile_side);
  const FrameSizes room = room_.sizes();
  shape_.visible_bound = room.visible;
  shape_.list_bound = room.list_entries;
  shape_.slice_bound = std::min(room.slices, most_slices(shape_));
}

/// Reserves memory for the frame's shape. Where lists need more memory, `headroom` adds some, so
/// that they do not need more again and again. Throws CudaError.
void CudaView::reserve(Headroom headroom) {
  FrameShape roomy = shape_;
  if (headroom == Headroom::some && !memory_.holds_lists(shape_)) {
    const FrameSizes most = room_.limits();
    roomy.visible_bound = std::min(most.visible, shape_.visible_bound + shape_.visible_bound / 4);
    roomy.list_bound = std::min(most.list_entries, shape_.list_bound + shape_.list_bound / 4);
  }
  if (memory_.reserve({.shape = roomy,
                       .scene = scene_->arrays(),
                       .in_pages = paged_.has_value(),
                       .settings = settings_})) {
    reach_known_ = false;
    ends_of_.reset();
  }
}

/// Sets the frame's shape and makes room for it. Where the device has too little memory, it first
/// gives up the headroom, then slices, then the farther part of the lists.
void CudaView::make_room(glm::ivec2 size_px) {
  const FrameRoom wanted = room_;
  Headroom headroom = Headroom::some;
  for (;;) {
    set_shape(size_px, tile_side_px);
    try {
      reserve(headroom);
      return;
    } catch (const CudaError& error) {
      memory_.release();
      reach_known_ = false;
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
  ListRequest listed(request.camera, plan, settings_.speculation);
  if (paged_) paged_->begin(request, plan);
  for (;;) {
    make_room(request.camera.size_px);
    times_.begin(stream_.get());
    listed.scene = scene_arrays();
    if (paged_) listed.cut = cut_tree(request, plan);
    listed.occlusion = want_occlusion(request.camera);
    list_tiles(listed);
    split();
    times_.end(Stage::sort, stream_.get());
    blend(request);
    deliver();
    if (!needs_more_room()) break;
    ends_of_.reset();  // this drawing has replaced the last frame's ends
  }
  reach_known_ = true;
  if (settings_.pipeline == Pipeline::catgs) ends_of_ = request.camera;
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

/// Finds what the last frame shows to be hidden in this one.
Occlusion CudaView::want_occlusion(const Camera& camera) {
  const ViewMemory& m = memory_;
  if (!ends_of_) return {};
  const auto now = make_camera_pair(camera).single, last = make_camera_pair(*ends_of_).single;
  const int radius = math::occlusion_radius<float>(now, last, mean_inverse_depth_, part_side_px);
  if (radius < 0) return {};
  launch_occlusion({.shape = shape_,
                    .now = now,
                    .last = last,
                    .radius = radius,
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

void CudaView::draw_sub(const FrameRequest& request) {
  const cudaStream_t stream = stream_.get();
  const ViewMemory& m = memory_;
  times_.begin(stream);
  constexpr std::size_t kept = offsetof(FrameCounts, nearness);
  check(cudaMemsetAsync(reinterpret_cast<std::byte*>(m.counts.get()) + kept, 0,
                        sizeof(FrameCounts) - kept, stream),
        "counts");
  const CameraPair now = make_camera_pair(request.camera);
  launch_project({.scene = scene_arrays(),
                  .camera = {.now = now, .end = now.single, .near_z = request.camera.near_z},
                  .shape = shape_,
                  .min_depth = speculation_min_depth(settings_.speculation, request.camera.near_z),
                  .counts = m.counts.get(),
                  .visible = m.visible.get(),
                  .records = m.records.get(),
                  .depth_key = m.depth.get(),
                  .splat_depth = nullptr,
                  .tile_count = nullptr,
                  .spans = nullptr,
                  .path = nullptr,
                  .order = nullptr},
                 Listing::none, stream);
  times_.end(Stage::project, stream);
  times_.end(Stage::bin, stream);
  split();
  times_.end(Stage::sort, stream);
  blend(request);
  deliver();
}

void CudaView::draw_vanilla(const FrameRequest& request) {
  const glm::vec3& b = request.background;
  const ViewMemory& m = memory_;
  const FrameShape picture{.width_px = request.camera.size_px.x,
                           .height_px = request.camera.size_px.y};
  (void)memory_.reserve({.shape = picture, .scene = {}, .in_pages = false, .settings = settings_});
  set_shape(request.camera.size_px, tile_size_px);
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
void CudaView::split() {
  const ViewMemory& m = memory_;
  // The mean that the last frame expected; 0: unknown.
  std::uint32_t mean = 0;
  if (const auto expected = m.host_counts.get()->expected_entries; reach_known_ && expected > 0)
    mean = std::max(1u, static_cast<std::uint32_t>(expected / shape_.tiles()));
  launch_split({.shape = shape_,
                .range = m.range.get(),
                .reach_known = reach_known_,
                .reach = m.reach.get(),
                .tasks = m.tasks.get(),
                .tile_slices = m.tile_slices.get(),
                .queue = m.queue.get(),
                .slice_transmittance = m.slice_transmittance.get(),
                .counts = m.counts.get(),
                .mean_list = mean,
                .split = settings_.split_tasks},
               stream_.get());
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
  const bool vanilla = settings_.pipeline == Pipeline::vanilla;
  const uint2* ranges = vanilla ? vanilla_.ranges() : memory_.range.get();
  if (ranges == nullptr) return {};
  check(cudaSetDevice(device_), "device");
  return cuda::tile_loads(shape_, ranges);
}

FrameView CudaView::finished(FrameKind kind, float near_z) {
  FrameView frame;
  frame.format = settings_.format;
  frame.size_px = {shape_.width_px, shape_.height_px};
  const std::size_t width = static_cast<std::size_t>(shape_.width_px);
  if (settings_.format == PixelFormat::i420) {
    std::byte* luma = memory_.host_image.get();
    std::byte* cb = luma + width * shape_.height_px;
    std::byte* cr = cb + width * shape_.height_px / 4;
    frame.space = MemorySpace::host;
    frame.planes = {Plane{luma, width}, Plane{cb, width / 2}, Plane{cr, width / 2}};
  } else {
    frame.space = settings_.space;
    std::byte* rgb = settings_.space == MemorySpace::host
                         ? memory_.host_image.get()
                         : reinterpret_cast<std::byte*>(memory_.rgb.get());
    frame.planes = {Plane{rgb, 3 * sizeof(float) * width}, Plane{}, Plane{}};
  }
  frame.depths = depths_.grid();
  frame.stats = frame_stats(*memory_.host_counts.get(), shape_, kind, near_z);
  if (paged_) paged_->end(frame.stats);
  mean_inverse_depth_ = frame.stats.mean_inverse_depth;
  times_.read(settings_.pipeline != Pipeline::vanilla && kind == FrameKind::key,
              frame.stats.stage_ms);
  return frame;
}

}  // namespace catgs::cuda

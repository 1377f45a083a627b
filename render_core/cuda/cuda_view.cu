#include <algorithm>
#include <cstddef>
#include <utility>

#include "render_core/cuda/blend.cuh"
#include "render_core/cuda/convert.cuh"
#include "render_core/cuda/cuda_view.cuh"
#include "render_core/cuda/frame_output.cuh"
#include "render_core/cuda/giants.cuh"
#include "render_core/cuda/pixel_runs.cuh"
#include "render_core/cuda/project.cuh"
#include "render_core/cuda/reorder.cuh"
#include "render_core/cuda/split.cuh"

namespace catgs::cuda {

namespace {

int processors_of(int device) {
  int processors = 0;
  check(cudaDeviceGetAttribute(&processors, cudaDevAttrMultiProcessorCount, device), "device");
  return processors;
}

/// The part of a shape that concerns the picture alone; it decides which Gaussians are in view.
FrameShape picture_of(FrameShape shape) {
  shape.first_x_px = shape.first_y_px = 0;
  shape.list_width_px = shape.width_px;
  shape.list_height_px = shape.height_px;
  return shape;
}

}  // namespace

CudaView::CudaView(std::shared_ptr<const DeviceScene> scene, int device,
                   const ViewSettings& settings)
    : scene_(std::move(scene)),
      device_(device),
      processors_(processors_of(device)),
      settings_(settings),
      driver_(settings),
      room_(scene_->arrays().count, settings.max_list_entries, settings.split_tasks),
      builder_(scene_->arrays(), memory_, processors_),
      blend_warps_(blend_warps(processors_)),
      reach_(memory_.reach, memory_.other_reach) {
  // The memory that does not depend on the image is the largest part of a small scene's View. A
  // device without room for it should say so while another can be chosen. For a large scene, only
  // the first frame tells how much is in view.
  if (settings.pipeline == Pipeline::vanilla) return;
  const glm::ivec2 one_tile(tile_size_px);
  set_shape(one_tile, image_grid(one_tile));
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
  reach_.forget();
  colours_known_ = false;
}

void CudaView::set_shape(glm::ivec2 size_px, const TileGrid& grid) {
  shape_.width_px = size_px.x;
  shape_.height_px = size_px.y;
  shape_.tiles_x = grid.tiles.x;
  shape_.tiles_y = grid.tiles.y;
  shape_.first_x_px = shape_.shown_x_px = grid.first_px.x;
  shape_.first_y_px = shape_.shown_y_px = grid.first_px.y;
  shape_.list_width_px = grid.size_px.x;
  shape_.list_height_px = grid.size_px.y;
  shape_.tile_parts = turns_tiles(settings_) ? most_run_parts : parts_per_tile;
  const glm::ivec2 image_tiles = image_grid(size_px).tiles;
  const auto in_image = static_cast<std::uint32_t>(image_tiles.x * image_tiles.y);
  // Grids of sub-frames differ in size. There is room for all, so that buffers settle.
  shape_.tile_bound = std::max(shape_.tiles(), in_image + in_image / 2 + 64);
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
  if (memory_.reserve({.shape = roomy, .scene = scene_->arrays(), .settings = settings_})) {
    reach_.forget();
    colours_known_ = false;
  }
}

/// Sets the frame's shape and makes room for it. Where the device has too little memory, it first
/// gives up the headroom, then slices, then the farther part of the lists.
void CudaView::make_room(glm::ivec2 size_px, const TileGrid& grid) {
  const FrameRoom wanted = room_;
  Headroom headroom = Headroom::some;
  for (;;) {
    set_shape(size_px, grid);
    try {
      reserve(headroom);
      return;
    } catch (const CudaError& error) {
      memory_.release();
      reach_.forget();
      colours_known_ = false;
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
  const ListRequest listed(request.camera, plan, settings_.speculation);
  turned_ = false;
  seeks_giants_ = false;
  for (;;) {
    make_room(request.camera.size_px, plan.grid);
    times_.begin(stream_.get());
    list_tiles(listed);
    split(nullptr, reach_.last(shape_, false));
    times_.end(Stage::sort, stream_.get());
    blend(request);
    deliver();
    if (!needs_more_room()) break;
    colours_known_ = false;  // Gaussians without room were marked too
  }
  reach_.keep(shape_, {});
}

/// Stages project, bin and most of sort of a key frame.
void CudaView::list_tiles(const ListRequest& request) {
  const cudaStream_t stream = stream_.get();
  builder_.cull(request, shape_, stream);
  const ColourArrays colours = want_colours(request.cameras.now.single);
  builder_.project(request, shape_, colours, stream);
  times_.end(Stage::project, stream);
  builder_.sort_by_depth(shape_, stream);
  times_.end_depth_sort(stream);
  builder_.emit(request, shape_, stream);
  times_.end(Stage::bin, stream);
  builder_.sort_by_tile(shape_, stream);
}

/// Returns false when a watched Gaussian came into view; then nothing was drawn.
bool CudaView::draw_sub(const FrameRequest& request, const FramePlan& plan) {
  const cudaStream_t stream = stream_.get();
  const ViewMemory& m = memory_;
  times_.begin(stream);
  constexpr std::size_t kept = offsetof(FrameCounts, nearness);
  check(cudaMemsetAsync(reinterpret_cast<std::byte*>(m.counts.get()) + kept, 0,
                        sizeof(FrameCounts) - kept, stream),
        "counts");
  const CameraPair now = make_camera_pair(request.camera);
  const float min_depth = speculation_min_depth(settings_.speculation, request.camera.near_z);
  const ColourArrays colours = want_colours(now.single);
  const GiantSet giants = want_giants(plan);
  launch_project({.scene = scene_->arrays(),
                  .camera = {.now = now, .end = now.single, .near_z = request.camera.near_z},
                  .shape = picture_of(shape_),
                  .min_depth = min_depth,
                  .counts = m.counts.get(),
                  .visible = m.visible.get(),
                  .colours = colours,
                  .records = m.records.get(),
                  .depth_key = m.depth.get(),
                  .tile_count = nullptr,
                  .spans = nullptr,
                  .path = nullptr,
                  .order = nullptr,
                  .giants = giants},
                 Listing::none, stream);
  times_.end(Stage::project, stream);
  place_tiles(plan);
  times_.end(Stage::bin, stream);
  const bool reorders = settings_.order == BlendOrder::fresh;
  split(reorders ? m.runs.get() : nullptr, reach_.last(shape_, true));
  if (reorders) reorder(giants);
  times_.end(Stage::sort, stream);
  blend(request);
  deliver();
  if (m.host_counts.get()->unlisted != 0) return false;
  reach_.keep(shape_, plan.list_from_frame);
  return true;
}

/// Decides whether a sub-frame looks for giants.
GiantSet CudaView::want_giants(const FramePlan& plan) {
  if (!plan.warped || settings_.order != BlendOrder::fresh) return {};
  const double spread = depth_spread<double>(
      plan.list_from_frame,
      {static_cast<double>(shape_.width_px), static_cast<double>(shape_.height_px)});
  std::uint32_t* bits = memory_.giants.get();
  if (!seeks_giants_) {
    if (spread < least_spread) return {};
    check(cudaMemsetAsync(bits, 0, giant_words * sizeof(std::uint32_t), stream_.get()), "giants");
    seeks_giants_ = true;
  }
  return {.list_from_frame = math::convert<float>(plan.list_from_frame),
          .least_variation = giant_variation(spread),
          .bits = bits};
}

/// Brings the lists of a sub-frame into its own depth order.
void CudaView::reorder(const GiantSet& giants) {
  const ViewMemory& m = memory_;
  const cudaStream_t stream = stream_.get();
  if (giants.bits != nullptr)
    launch_giants({.shape = shape_,
                   .bits = giants.bits,
                   .range = m.range.get(),
                   .ordered = m.ordered.get(),
                   .depth_key = m.depth.get(),
                   .slot = m.slot.get(),
                   .counts = m.counts.get(),
                   .processors = processors_},
                  stream);
  launch_reorder({.runs = m.runs.get(),
                  .counts = m.counts.get(),
                  .depth_key = m.depth.get(),
                  .slot = m.slot.get(),
                  .processors = processors_},
                 stream);
}

/// Assigns the pixels of a sub-frame to the tiles of its key frame.
void CudaView::place_tiles(const FramePlan& plan) {
  turned_ = plan.warped;
  shape_.shown_x_px = shape_.first_x_px - plan.shift_px.x;
  shape_.shown_y_px = shape_.first_y_px - plan.shift_px.y;
  if (!turned_) return;
  launch_pixel_runs({.shape = shape_,
                     .list_from_frame = math::convert<float>(plan.list_from_frame),
                     .frame_from_list = math::convert<float>(math::inverse(plan.list_from_frame)),
                     .pixels = memory_.pixels.get(),
                     .pixel_count = memory_.pixel_count.get()},
                    stream_.get());
}

/// Decides which Gaussians in view are shaded for the camera.
ColourArrays CudaView::want_colours(const math::CameraModel<float>& camera) {
  const ViewMemory& m = memory_;
  if (settings_.pipeline != Pipeline::catgs || !settings_.colour_cache) return {};
  const ColourArrays colours = m.colour_arrays();
  if (!colours_known_) forget_colours(colours, scene_->arrays().cluster_count, stream_.get());
  colours_known_ = true;
  const math::Vec3<float>& at = camera.position;
  launch_want_colours({.scene = scene_->arrays(),
                       .position = {at.x, at.y, at.z},
                       .counts = m.counts.get(),
                       .clusters = m.clusters.get(),
                       .mask = m.cull_mask.get(),
                       .colours = colours},
                      stream_.get());
  return colours;
}

void CudaView::draw_vanilla(const FrameRequest& request) {
  const glm::vec3& b = request.background;
  const ViewMemory& m = memory_;
  const FrameShape picture{.width_px = request.camera.size_px.x,
                           .height_px = request.camera.size_px.y};
  (void)memory_.reserve({.shape = picture, .scene = {}, .settings = settings_});
  set_shape(request.camera.size_px, image_grid(request.camera.size_px));
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

/// Cuts the tiles into tasks, and into runs if the reorder stage follows.
void CudaView::split(ReorderRun* runs, const LastReach& last) {
  const ViewMemory& m = memory_;
  // The mean that the last frame expected; 0: unknown.
  std::uint32_t mean = 0;
  if (const auto expected = m.host_counts.get()->expected_entries; last.reach && expected > 0)
    mean = std::max(1u, static_cast<std::uint32_t>(expected / shape_.tiles()));
  launch_split({.shape = shape_,
                .range = m.range.get(),
                .last = last,
                .reach = reach_.current(),
                .pixel_count = turned_ ? m.pixel_count.get() : nullptr,
                .tasks = m.tasks.get(),
                .tile_slices = m.tile_slices.get(),
                .queue = m.queue.get(),
                .runs = runs,
                .ordered = m.ordered.get(),
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
  const PixelPlace* pixels = turned_ ? m.pixels.get() : nullptr;
  const std::uint32_t* pixel_count = turned_ ? m.pixel_count.get() : nullptr;
  launch_blend({.shape = shape_,
                .records = m.records.get(),
                .slot = m.slot.get(),
                .tasks = m.tasks.get(),
                .queue = m.queue.get(),
                .background = background,
                .rgb = m.rgb.get(),
                .pixels = pixels,
                .pixel_count = pixel_count,
                .slice_pixels = m.slice_pixels.get(),
                .consumed = m.consumed.get(),
                .slice_transmittance = m.slice_transmittance.get(),
                .reach = reach_.current(),
                .counts = m.counts.get(),
                .count_pairs = settings_.count_pairs,
                .warps = blend_warps_},
               stream);
  launch_composite({.shape = shape_,
                    .tasks = m.tasks.get(),
                    .tile_slices = m.tile_slices.get(),
                    .slice_pixels = m.slice_pixels.get(),
                    .consumed = m.consumed.get(),
                    .pixels = pixels,
                    .pixel_count = pixel_count,
                    .counts = m.counts.get(),
                    .background = background,
                    .rgb = m.rgb.get(),
                    .reach = reach_.current()},
                   stream);
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

std::size_t CudaView::memory_bytes() const { return memory_.bytes() + vanilla_.bytes(); }

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
  frame.stats = frame_stats(*memory_.host_counts.get(), shape_, kind, near_z);
  times_.read(settings_.pipeline != Pipeline::vanilla && kind == FrameKind::key,
              frame.stats.stage_ms);
  return frame;
}

}  // namespace catgs::cuda

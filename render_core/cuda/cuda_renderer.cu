#include <algorithm>
#include <utility>

#include <cuda_runtime_api.h>

#include "render_core/cuda/bin.cuh"
#include "render_core/cuda/blend.cuh"
#include "render_core/cuda/convert.cuh"
#include "render_core/cuda/cuda_renderer.h"
#include "render_core/cuda/device_scene.cuh"
#include "render_core/cuda/frame_memory.cuh"
#include "render_core/cuda/project.cuh"
#include "render_core/cuda/sort.cuh"
#include "render_core/error.h"

namespace catgs {
namespace cuda {
namespace {

class Stream {
 public:
  Stream() { check(cudaStreamCreateWithFlags(&stream_, cudaStreamNonBlocking), "stream"); }
  ~Stream() { (void)cudaStreamDestroy(stream_); }
  Stream(const Stream&) = delete;
  Stream& operator=(const Stream&) = delete;
  [[nodiscard]] cudaStream_t get() const { return stream_; }

 private:
  cudaStream_t stream_ = nullptr;
};

class Event {
 public:
  Event() { check(cudaEventCreate(&event_), "event"); }
  ~Event() { (void)cudaEventDestroy(event_); }
  Event(const Event&) = delete;
  Event& operator=(const Event&) = delete;
  [[nodiscard]] cudaEvent_t get() const { return event_; }

 private:
  cudaEvent_t event_ = nullptr;
};

class CudaView final : public View {
 public:
  CudaView(std::shared_ptr<const DeviceScene> scene, int device, const ViewSettings& settings)
      : scene_(std::move(scene)), device_(device), settings_(settings) {}

  RenderStatus render(const FrameRequest& request, FrameView& frame) noexcept override {
    if (RenderStatus bad = check_request(request, settings_.format); !bad.ok()) return bad;
    try {
      check(cudaSetDevice(device_), "device");
      set_shape(request.camera.size_px);
      // A frame that found its buffers too small is drawn again with room for what it counted.
      do {
        memory_.reserve(shape_, project_blocks(scene_->arrays().count), settings_);
        enqueue(request);
        check(cudaStreamSynchronize(stream_.get()), "frame");
      } while (outgrown());
      fill(frame);
      return {};
    } catch (const CudaError& error) {
      return {error.status_code(), error.what()};
    } catch (const std::exception& error) {
      return {RenderStatus::Code::device_failed, error.what()};
    }
  }

  std::size_t memory_bytes() const override { return memory_.bytes(); }

 private:
  void set_shape(glm::ivec2 size_px) {
    shape_.width_px = size_px.x;
    shape_.height_px = size_px.y;
    shape_.tiles_x = (size_px.x + tile_size_px - 1) / tile_size_px;
    shape_.tiles_y = (size_px.y + tile_size_px - 1) / tile_size_px;
    const std::uint32_t count = scene_->arrays().count;
    // First guesses; outgrown() corrects them after the first frame.
    shape_.visible_bound = std::max(shape_.visible_bound, count / 4 + 1);
    const std::uint64_t list_guess = std::min<std::uint64_t>(count + 65536ull, list_limit());
    shape_.list_bound = std::max(shape_.list_bound, static_cast<std::uint32_t>(list_guess));
  }

  /// Whether the finished frame needed more room than it had; then the bounds have grown, the list
  /// bound up to max_list_entries. They follow what frames need with a margin: the padding up to
  /// them is sorted too.
  bool outgrown() {
    const FrameCounts& counts = *memory_.host_counts.get();
    const auto grow = [](std::uint32_t& bound, std::uint32_t needed, std::uint64_t limit) {
      const std::uint64_t wanted = std::min(needed + std::uint64_t{needed} / 8 + 4096, limit);
      if (needed <= bound || wanted <= bound) return false;
      bound = static_cast<std::uint32_t>(wanted);
      return true;
    };
    const bool more_visible = grow(shape_.visible_bound, counts.visible, scene_->arrays().count);
    const bool longer_lists = grow(shape_.list_bound, counts.list_entries, list_limit());
    return more_visible || longer_lists;
  }

  [[nodiscard]] std::uint64_t list_limit() const {
    return std::clamp<std::uint64_t>(settings_.max_list_entries, 1, list_entries_limit);
  }

  void enqueue(const FrameRequest& request);
  void fill(FrameView& frame);
  void mark(Stage stage) {
    check(cudaEventRecord(after_[static_cast<std::size_t>(stage)].get(), stream_.get()), "event");
  }

  std::shared_ptr<const DeviceScene> scene_;
  int device_;
  ViewSettings settings_;
  Stream stream_;
  Event start_;
  Event after_[stage_count];
  FrameShape shape_;
  FrameMemory memory_;
};

void CudaView::enqueue(const FrameRequest& request) {
  const cudaStream_t stream = stream_.get();
  FrameMemory& m = memory_;
  const SceneArrays& scene = scene_->arrays();
  check(cudaEventRecord(start_.get(), stream), "event");
  check(cudaMemsetAsync(m.counts.get(), 0, sizeof(FrameCounts), stream), "counts");
  check(cudaMemsetAsync(m.block_state.get(), 0, m.block_state.bytes(), stream), "look-back");

  const auto camera = math::make_camera_model(request.camera);
  launch_project({scene, math::convert<float>(camera), camera, shape_, m.records.get(),
                  m.depth[0].get(), m.tile_count.get(), m.block_state.get(), m.counts.get()},
                 stream);
  mark(Stage::project);

  const SortScratch scratch{m.scratch.get(), m.scratch.bytes()};
  PingPong<std::uint32_t> depth{m.depth[0].get(), m.depth[1].get()};
  PingPong<std::uint32_t> order{m.order[0].get(), m.order[1].get()};
  sort_by_depth(shape_, m.counts.get(), depth, order, scratch, stream);
  scan_tile_counts(shape_, m.counts.get(), order.current, m.tile_count.get(), m.first.get(),
                   scratch, stream);
  launch_emit({shape_, m.counts.get(), m.records.get(), order.current, m.first.get(),
               m.tile_count.get(), m.tile[0].get(), m.slot[0].get()},
              stream);
  mark(Stage::bin);

  PingPong<std::uint32_t> tile{m.tile[0].get(), m.tile[1].get()};
  PingPong<std::uint32_t> slot{m.slot[0].get(), m.slot[1].get()};
  sort_by_tile(shape_, tile, slot, scratch, stream);
  launch_ranges({shape_, tile.current, m.range.get()}, stream);
  mark(Stage::sort);

  const glm::vec3& b = request.background;
  launch_blend({shape_, m.records.get(), slot.current, m.range.get(), make_float3(b.x, b.y, b.z),
                m.rgb.get(), m.counts.get(), settings_.count_pairs},
               stream);
  mark(Stage::blend);

  if (settings_.format == PixelFormat::i420) {
    const std::size_t luma = static_cast<std::size_t>(shape_.width_px) * shape_.height_px;
    launch_convert({shape_.width_px, shape_.height_px, m.rgb.get(), m.i420.get(),
                    m.i420.get() + luma, m.i420.get() + luma + luma / 4},
                   stream);
    check(cudaMemcpyAsync(m.host_image.get(), m.i420.get(), luma + luma / 2, cudaMemcpyDeviceToHost,
                          stream),
          "image copy");
  } else if (settings_.space == MemorySpace::host) {
    const std::size_t bytes =
        sizeof(float) * 3 * static_cast<std::size_t>(shape_.width_px) * shape_.height_px;
    check(cudaMemcpyAsync(m.host_image.get(), m.rgb.get(), bytes, cudaMemcpyDeviceToHost, stream),
          "image copy");
  }
  check(cudaMemcpyAsync(m.host_counts.get(), m.counts.get(), sizeof(FrameCounts),
                        cudaMemcpyDeviceToHost, stream),
        "counts");
  mark(Stage::convert);
}

void CudaView::fill(FrameView& frame) {
  const FrameCounts& counts = *memory_.host_counts.get();
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
  frame.stats = {};
  frame.stats.visible = counts.visible;
  frame.stats.list_entries = std::min(counts.list_entries, shape_.list_bound);
  frame.stats.list_max = counts.list_max;
  frame.stats.blended_pairs = counts.blended_pairs;
  if (counts.list_entries > shape_.list_bound) {
    frame.stats.overflowed_entries = counts.list_entries - shape_.list_bound;
  }
  cudaEvent_t before = start_.get();
  for (std::size_t i = 0; i < stage_count; ++i) {
    check(cudaEventElapsedTime(&frame.stats.stage_ms[i], before, after_[i].get()), "stage time");
    before = after_[i].get();
  }
}

class CudaRenderer final : public Renderer {
 public:
  CudaRenderer(const GaussianCloud& cloud, int device) : device_(device) {
    check(cudaSetDevice(device), "device");
    cudaDeviceProp properties{};
    check(cudaGetDeviceProperties(&properties, device), "device properties");
    name_ = properties.name;
    scene_ = std::make_shared<const DeviceScene>(cloud);
  }

  [[nodiscard]] std::string description() const override { return "CUDA, " + name_; }
  [[nodiscard]] std::size_t scene_bytes() const override { return scene_->bytes(); }
  [[nodiscard]] std::unique_ptr<View> make_view(const ViewSettings& settings) override {
    if (settings.pipeline != Pipeline::exact) {
      throw InputError("--pipeline", "", "the CUDA core renders the exact pipeline only",
                       "use --pipeline exact, or --renderer cpu");
    }
    check(cudaSetDevice(device_), "device");
    return std::make_unique<CudaView>(scene_, device_, settings);
  }

 private:
  int device_;
  std::string name_;
  std::shared_ptr<const DeviceScene> scene_;
};

}  // namespace
}  // namespace cuda

std::string cuda_obstacle() {
  int devices = 0;
  if (const cudaError_t code = cudaGetDeviceCount(&devices); code != cudaSuccess) {
    return cudaGetErrorString(code);
  }
  return devices > 0 ? "" : "no CUDA device";
}

std::unique_ptr<Renderer> make_cuda_renderer(const GaussianCloud& cloud, int device) {
  try {
    return std::make_unique<cuda::CudaRenderer>(cloud, device);
  } catch (const cuda::CudaError& error) {
    throw InputError("--renderer cuda", "", error.what(), "use --renderer cpu");
  }
}

}  // namespace catgs

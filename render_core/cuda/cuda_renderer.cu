#include <algorithm>
#include <cstdio>
#include <functional>
#include <future>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <cuda_runtime_api.h>

#include "render_core/cuda/cuda_renderer.h"
#include "render_core/cuda/device_buffer.h"
#include "render_core/cuda/eye_views.cuh"
#include "render_core/cuda/place_view.h"

namespace catgs {
namespace cuda {
namespace {

constexpr int oldest_major = 8;  // compute capability

/// An empty kernel. If it has no code for a device, the build lacks code for that device.
__global__ void probe() {}

/// A device with its copy of the scene.
struct Device {
  int index = 0;
  std::string name;
  std::shared_ptr<const DeviceScene> scene;
};

/// A View and its slot on a device.
class ViewInSlot final : public View {
 public:
  ViewInSlot(const Device& device, DeviceSet::Slot slot, const ViewSettings& settings)
      : slot_(std::move(slot)), view_(std::in_place, device.scene, device.index, settings) {}
  ~ViewInSlot() override {
    // Freeing creates a context on the current device, which must not be one that nobody selected.
    (void)cudaSetDevice(slot_.device());
    view_.reset();
    trim_pool();
  }

  RenderStatus render(const FrameRequest& request, FrameView& frame) noexcept override {
    return view_->render(request, frame);
  }
  [[nodiscard]] std::vector<std::uint32_t> tile_loads() const override {
    return view_->tile_loads();
  }
  [[nodiscard]] std::size_t memory_bytes() const override { return view_->memory_bytes(); }
  [[nodiscard]] bool outdated() const override { return view_->outdated(); }
  [[nodiscard]] std::optional<int> device() const override { return slot_.device(); }

 private:
  DeviceSet::Slot slot_;
  std::optional<EyeViews> view_;
};

class CudaRenderer final : public Renderer {
 public:
  CudaRenderer(std::vector<Device> devices, std::shared_ptr<DeviceSet> set)
      : devices_(std::move(devices)), set_(std::move(set)) {
    for (const Device& device : devices_) set_->add(device.index);
  }

  [[nodiscard]] std::string description() const override {
    std::vector<std::pair<std::string, int>> models;
    for (const Device& device : devices_) {
      const auto same = [&](const auto& model) { return model.first == device.name; };
      const auto known = std::find_if(models.begin(), models.end(), same);
      if (known == models.end()) {
        models.emplace_back(device.name, 1);
      } else {
        ++known->second;
      }
    }
    std::string text = "CUDA";
    for (const auto& [name, count] : models) {
      text += ", " + (count > 1 ? std::to_string(count) + " x " : std::string()) + name;
    }
    return text;
  }

  [[nodiscard]] std::size_t scene_bytes() const override { return devices_.front().scene->bytes(); }

  [[nodiscard]] std::vector<PageFigures> pages() const override {
    std::vector<PageFigures> all;
    for (const Device& device : devices_) {
      if (device.scene->tree() == nullptr) continue;
      all.push_back(device.scene->tree()->figures());
      all.back().device = device.index;
    }
    return all;
  }

  [[nodiscard]] bool has_windows(Pipeline pipeline) const override { return has_groups(pipeline); }

  [[nodiscard]] std::unique_ptr<View> make_view(const ViewSettings& settings) override {
    std::vector<int> candidates;
    for (const Device& device : devices_) candidates.push_back(device.index);
    return place_view(*set_, std::move(candidates), [&](DeviceSet::Slot slot) {
      return make_view_at(std::move(slot), settings);
    });
  }

 private:
  [[nodiscard]] std::unique_ptr<View> make_view_at(DeviceSet::Slot slot,
                                                   const ViewSettings& settings) const {
    const auto device =
        std::find_if(devices_.begin(), devices_.end(),
                     [&](const Device& candidate) { return candidate.index == slot.device(); });
    check(cudaSetDevice(device->index), "device");
    return std::make_unique<ViewInSlot>(*device, std::move(slot), settings);
  }

  std::vector<Device> devices_;
  std::shared_ptr<DeviceSet> set_;
};

/// Makes the device the current one of the calling thread, if the core can use it. Otherwise throws
/// DevicesUnusable with a remedy.
void use_device(const std::string& flag, int index, const cudaDeviceProp& properties) {
  const auto version = [&](const char* separator) {
    return std::to_string(properties.major) + separator + std::to_string(properties.minor);
  };
  if (properties.major < oldest_major) {
    throw DevicesUnusable(flag, properties.name,
                          "has compute capability " + version(".") + ", the CUDA core needs " +
                              std::to_string(oldest_major) + ".0",
                          "choose another device, or --renderer cpu");
  }
  check(cudaSetDevice(index), "device");
  keep_pool();
  cudaFuncAttributes attributes{};
  if (const cudaError_t code = cudaFuncGetAttributes(&attributes, probe); code != cudaSuccess) {
    (void)cudaGetLastError();
    throw DevicesUnusable(
        flag, properties.name, cudaGetErrorString(code),
        "is this program built for it, with -DCMAKE_CUDA_ARCHITECTURES=" + version("") + "?");
  }
}

std::string free_memory() {
  std::size_t free = 0, total = 0;
  if (cudaMemGetInfo(&free, &total) != cudaSuccess) return "";
  char text[64];
  std::snprintf(text, sizeof(text), ", %.1f of %.1f GB are free", 1e-9 * static_cast<double>(free),
                1e-9 * static_cast<double>(total));
  return text;
}

/// Makes the scene on the current device, which has this number. Throws CudaError.
using MakeScene = std::function<DeviceScene*(int device)>;

/// Makes the scene on a device, which becomes the current one of the calling thread. Throws
/// DevicesUnusable.
Device open_device(const MakeScene& make, int index) {
  const std::string flag = "--device " + std::to_string(index);
  cudaDeviceProp properties{};
  try {
    check(cudaGetDeviceProperties(&properties, index), "device properties");
    use_device(flag, index, properties);
    const auto free_there = [index](const DeviceScene* scene) {
      (void)cudaSetDevice(index);  // see ~ViewInSlot()
      delete scene;
    };
    return {index, properties.name, {make(index), free_there}};
  } catch (const CudaError& error) {
    const bool full = error.status_code() == RenderStatus::Code::out_of_memory;
    throw DevicesUnusable(
        flag, properties.name, error.what() + (full ? free_memory() : std::string()),
        full ? "choose another device or a smaller scene, or --renderer cpu"
             : "does nvidia-smi say why? Choose another device, or --renderer cpu");
  }
}

}  // namespace
}  // namespace cuda

std::string cuda_obstacle() {
  int devices = 0;
  if (const cudaError_t code = cudaGetDeviceCount(&devices); code != cudaSuccess) {
    return cudaGetErrorString(code);
  }
  for (int device = 0; device < devices; ++device) {
    int major = 0;
    (void)cudaDeviceGetAttribute(&major, cudaDevAttrComputeCapabilityMajor, device);
    if (major >= cuda::oldest_major) return "";
  }
  if (devices == 0) return "no CUDA device";
  return "no CUDA device of compute capability " + std::to_string(cuda::oldest_major) +
         ".0 or more";
}

namespace {

MadeRenderer make_on(const std::shared_ptr<DeviceSet>& devices, const cuda::MakeScene& make) {
  if (const std::string obstacle = cuda_obstacle(); !obstacle.empty())
    throw DevicesUnusable("--renderer cuda", "", obstacle, "use --renderer cpu");
  int count = 0;
  (void)cudaGetDeviceCount(&count);
  std::vector<std::future<cuda::Device>> uploads;
  for (const int index : devices->among(count)) {
    uploads.push_back(std::async(std::launch::async, cuda::open_device, std::cref(make), index));
  }
  std::vector<cuda::Device> opened;
  std::string left_out;
  for (auto& upload : uploads) {
    try {
      opened.push_back(upload.get());
    } catch (const DevicesUnusable& error) {
      if (!devices->all()) throw;
      left_out.append(left_out.empty() ? "without " : "; ").append(error.what());
    }
  }
  if (opened.empty()) throw DevicesUnusable("--device all", "", left_out);
  return {std::make_unique<cuda::CudaRenderer>(std::move(opened), devices), left_out};
}

}  // namespace

MadeRenderer make_cuda_renderer(const GaussianCloud& cloud, std::shared_ptr<DeviceSet> devices,
                                ThreadPool& pool) {
  const cuda::SceneSource source{cloud, morton_order(cloud.mean, pool), pool};
  return make_on(devices, [&](int) { return new cuda::DeviceScene(source); });
}

MadeRenderer make_cuda_renderer(std::shared_ptr<TreeFile> tree, const RendererOptions& options,
                                std::shared_ptr<DeviceSet> devices) {
  return make_on(devices, [&](int device) { return new cuda::DeviceScene(tree, options, device); });
}

}  // namespace catgs

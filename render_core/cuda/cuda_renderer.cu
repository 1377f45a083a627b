#include <utility>

#include <cuda_runtime_api.h>

#include "render_core/cuda/cuda_renderer.h"
#include "render_core/cuda/cuda_view.cuh"
#include "render_core/error.h"

namespace catgs {
namespace cuda {
namespace {

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

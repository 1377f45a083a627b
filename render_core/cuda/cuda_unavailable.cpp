#include "render_core/base/error.h"
#include "render_core/cuda/cuda_renderer.h"

// Stands in for the CUDA core in builds without nvcc.
namespace catgs {

std::string cuda_obstacle() { return "this build has no CUDA core"; }

namespace {

[[noreturn]] void refuse() {
  throw InputError("--renderer cuda", "", cuda_obstacle(), "use auto or cpu");
}

}  // namespace

MadeRenderer make_cuda_renderer(const GaussianCloud& /*cloud*/,
                                std::shared_ptr<DeviceSet> /*devices*/, ThreadPool& /*pool*/) {
  refuse();
}

MadeRenderer make_cuda_renderer(std::shared_ptr<TreeFile> /*tree*/,
                                const RendererOptions& /*options*/,
                                std::shared_ptr<DeviceSet> /*devices*/) {
  refuse();
}

}  // namespace catgs

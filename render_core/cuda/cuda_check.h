#pragma once

#include <string>

#include <cuda_runtime_api.h>

#include "render_core/frame/device_error.h"

namespace catgs::cuda {

/// A failed CUDA call, thrown inside the core. It leaves the core during set-up; the frame path
/// turns it into a RenderStatus.
class CudaError : public DeviceError {
 public:
  CudaError(const char* stage, cudaError_t code)
      : DeviceError(code == cudaErrorMemoryAllocation ? RenderStatus::Code::out_of_memory
                                                      : RenderStatus::Code::device_failed,
                    std::string(stage) + ": " + cudaGetErrorString(code)) {}
};

/// `stage` names the failed activity, for people.
inline void check(cudaError_t code, const char* stage) {
  if (code != cudaSuccess) {
    (void)cudaGetLastError();  // a launch error is sticky until read
    throw CudaError(stage, code);
  }
}

/// Call right after every kernel launch.
inline void check_launch(const char* stage) { check(cudaGetLastError(), stage); }

}  // namespace catgs::cuda

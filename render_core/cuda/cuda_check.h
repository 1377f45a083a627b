#pragma once

#include <stdexcept>
#include <string>

#include <cuda_runtime_api.h>

#include "render_core/renderer.h"

namespace catgs::cuda {

/// A failed CUDA call, thrown inside the core: set-up lets it out, the frame path turns it into a
/// RenderStatus at its edge.
class CudaError : public std::runtime_error {
 public:
  CudaError(const char* stage, cudaError_t code)
      : std::runtime_error(std::string(stage) + ": " + cudaGetErrorString(code)), code_(code) {}

  [[nodiscard]] RenderStatus::Code status_code() const {
    return code_ == cudaErrorMemoryAllocation ? RenderStatus::Code::out_of_memory
                                              : RenderStatus::Code::device_failed;
  }

 private:
  cudaError_t code_;
};

/// `stage` names what was being done, for people.
inline void check(cudaError_t code, const char* stage) {
  if (code != cudaSuccess) {
    (void)cudaGetLastError();  // a launch error is sticky until read
    throw CudaError(stage, code);
  }
}

/// Call right after every kernel launch.
inline void check_launch(const char* stage) { check(cudaGetLastError(), stage); }

}  // namespace catgs::cuda

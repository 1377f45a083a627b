#pragma once

#include <cstdint>

#include <cuda_runtime_api.h>

namespace catgs::cuda {

/// Float RGB to I420 (BT.709 limited range, chroma averaged over and sited at the centre of 2x2
/// pixels). Sides are even.
struct ConvertParams {
  int width_px = 0, height_px = 0;
  const float* rgb = nullptr;  // [height][width][3]
  std::uint8_t* luma = nullptr;
  std::uint8_t* cb = nullptr;
  std::uint8_t* cr = nullptr;
};
void launch_convert(const ConvertParams& params, cudaStream_t stream);

}  // namespace catgs::cuda

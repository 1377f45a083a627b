#include <cassert>

#include "render_core/cuda/convert.cuh"
#include "render_core/cuda/cuda_check.h"
#include "render_core/math/colour-inl.h"

namespace catgs::cuda {
namespace {

__device__ std::uint8_t code(float value) { return static_cast<std::uint8_t>(value + 0.5f); }

/// One thread per 2x2 pixels.
__global__ void convert_kernel(const ConvertParams p) {
  const int x = 2 * static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  const int y = 2 * static_cast<int>(blockIdx.y * blockDim.y + threadIdx.y);
  if (x >= p.width_px || y >= p.height_px) return;
  math::Vec3<float> sum{0.0f, 0.0f, 0.0f};
  for (int j = 0; j < 2; ++j) {
    const std::size_t row = static_cast<std::size_t>(y + j) * p.width_px + x;
    const float2* in = reinterpret_cast<const float2*>(p.rgb + 3 * row);  // two pixels
    const float2 a = in[0], b = in[1], c = in[2];
    const math::Vec3<float> left{a.x, a.y, b.x}, right{b.y, c.x, c.y};
    reinterpret_cast<uchar2&>(p.luma[row]) =
        make_uchar2(code(math::luma_code(left)), code(math::luma_code(right)));
    sum = {sum.x + left.x + right.x, sum.y + left.y + right.y, sum.z + left.z + right.z};
  }
  const auto chroma = math::chroma_codes<float>(sum * 0.25f);
  const std::size_t at = static_cast<std::size_t>(y / 2) * (p.width_px / 2) + x / 2;
  p.cb[at] = code(chroma.x);
  p.cr[at] = code(chroma.y);
}

}  // namespace

void launch_convert(const ConvertParams& params, cudaStream_t stream) {
  assert(params.width_px % 2 == 0 && params.height_px % 2 == 0);
  const dim3 block(32, 8);
  const dim3 grid((params.width_px / 2 + block.x - 1) / block.x,
                  (params.height_px / 2 + block.y - 1) / block.y);
  convert_kernel<<<grid, block, 0, stream>>>(params);
  check_launch("convert");
}

}  // namespace catgs::cuda

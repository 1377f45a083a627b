#include <algorithm>
#include <cmath>
#include <vector>

#include <cuda_fp16.h>

#include "render_core/cuda/device_scene.cuh"
#include "render_core/math/projection-inl.h"

namespace catgs::cuda {
namespace {

// Host to device in pieces, so that set-up needs little memory beside the cloud.
constexpr std::size_t upload_chunk = std::size_t{1} << 18;

template <class T, class Make>
void upload(DeviceBuffer<T>& target, std::size_t count, std::size_t per_item, Make&& make) {
  target.reserve(std::max<std::size_t>(count * per_item, 1));
  std::vector<T> staging;
  for (std::size_t first = 0; first < count; first += upload_chunk) {
    const std::size_t last = std::min(count, first + upload_chunk);
    staging.assign((last - first) * per_item, T{});
    for (std::size_t i = first; i < last; ++i) make(i, &staging[(i - first) * per_item]);
    check(cudaMemcpy(target.get() + first * per_item, staging.data(), staging.size() * sizeof(T),
                     cudaMemcpyHostToDevice),
          "scene upload");
  }
}

math::CovarianceFactor<float> factor_of(const GaussianCloud& cloud, std::size_t i) {
  const glm::quat& q = cloud.rotation[i];
  const glm::vec3& s = cloud.scale[i];
  const double rotation[4] = {q.x, q.y, q.z, q.w};
  const auto l = math::covariance_factor<double>(rotation, {s.x, s.y, s.z});
  return {float(l.xx), float(l.yx), float(l.yy), float(l.zx), float(l.zy), float(l.zz)};
}

}  // namespace

DeviceScene::DeviceScene(const GaussianCloud& cloud) {
  const std::size_t n = cloud.size();
  upload(mean_opacity_, n, 1, [&](std::size_t i, float4* out) {
    const glm::vec3& m = cloud.mean[i];
    *out = make_float4(m.x, m.y, m.z, std::log2(cloud.opacity[i]));
  });
  upload(factor_a_, n, 1, [&](std::size_t i, float4* out) {
    const auto l = factor_of(cloud, i);
    *out = make_float4(l.xx, l.yx, l.yy, l.zx);
  });
  upload(factor_b_, n, 1, [&](std::size_t i, float2* out) {
    const auto l = factor_of(cloud, i);
    *out = make_float2(l.zy, l.zz);
  });
  const int floats = 3 * cloud.sh_count();
  constexpr int halfs_per_word = sizeof(uint4) / sizeof(__half);
  const int stride = (floats + halfs_per_word - 1) / halfs_per_word;
  upload(sh_, n, static_cast<std::size_t>(stride), [&](std::size_t i, uint4* out) {
    const float* in = &cloud.sh_of(i)->x;
    std::transform(in, in + floats, reinterpret_cast<__half*>(out),
                   [](float value) { return __float2half_rn(value); });
  });
  // Copies from pageable memory may return before they end, and Views' streams do not wait for
  // them.
  check(cudaStreamSynchronize(cudaStreamLegacy), "scene upload");
  arrays_ = {static_cast<std::uint32_t>(n),
             cloud.sh_degree,
             stride,
             mean_opacity_.get(),
             factor_a_.get(),
             factor_b_.get(),
             sh_.get()};
}

}  // namespace catgs::cuda

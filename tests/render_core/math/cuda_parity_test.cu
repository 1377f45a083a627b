// The formulas on a CUDA device against the same formulas on the host, in float, and in double.

#include <cmath>
#include <cstdint>
#include <vector>

#include <gtest/gtest.h>

#include "render_core/base/host_device.h"
#include "render_core/math/blend-inl.h"
#include "render_core/math/camera-inl.h"
#include "render_core/math/colour-inl.h"
#include "render_core/math/ellipse-inl.h"
#include "render_core/math/projection-inl.h"
#include "render_core/math/spherical_harmonics-inl.h"
#include "render_core/math/trail-inl.h"

namespace catgs {
namespace {

/// One Gaussian, one pixel and everything that the formulas say about them.
template <class T>
struct Sample {
  math::CameraModel<T> camera;
  math::Vec3<T> mean, scale;
  T rotation[4];
  T opacity;
  math::Vec3<T> sh[16];
  math::Vec2<T> pixel_px;
};

constexpr int result_count = 22;

template <class T>
struct Results {
  T value[result_count];
};

template <class T>
CATGS_HD Results<T> evaluate(const Sample<T>& s) {
  const T depth = math::view_depth(s.camera, s.mean);
  const auto factor = math::covariance_factor(s.rotation, s.scale);
  const auto p = math::project(s.camera, s.mean, factor, depth);
  const auto w = math::whitening(p);
  const T log2_opacity = log2(s.opacity);
  const T reach = math::reach_of(log2_opacity);
  const auto half = math::half_extent(p, reach);
  const T rightmost = math::rightmost_y(w, reach);
  const auto ellipse = math::make_ellipse(w, reach, half.x, rightmost);
  const auto columns = math::columns_in_band(ellipse, T(-0.5) * half.y, T(0.5) * half.y);
  const auto trail = math::make_trail(ellipse, {T(9) * s.pixel_px.y, T(-9) * s.pixel_px.x});
  const auto swept = math::columns_in_band(trail, T(-0.5) * half.y, T(0.5) * half.y);

  T basis[16];
  math::sh_basis(math::view_direction(s.camera.position, s.mean), 3, basis);
  math::Vec3<T> sum{T(0), T(0), T(0)};
  for (int k = 0; k < 16; ++k)
    sum = {sum.x + basis[k] * s.sh[k].x, sum.y + basis[k] * s.sh[k].y,
           sum.z + basis[k] * s.sh[k].z};
  const math::Vec3<T> colour{math::colour_from_sh_sum(sum.x), math::colour_from_sh_sum(sum.y),
                             math::colour_from_sh_sum(sum.z)};

  // A pixel near the centre, blended twice over a background.
  auto pixel = math::empty_pixel<T>();
  const T square = math::whitened_square(w, s.pixel_px);
  math::blend(pixel, log2_opacity - square, colour);
  math::blend(pixel, log2_opacity - T(0.5) * square, colour);
  const auto rgb = math::resolve(pixel, math::Vec3<T>{T(0.2), T(0.4), T(0.6)});
  const auto chroma = math::chroma_codes(rgb);
  return {depth,    p.centre_px.x, p.centre_px.y, w.xx,        w.xy,         w.yy,
          half.x,   half.y,        rightmost,     columns.low, columns.high, colour.x,
          colour.y, colour.z,      rgb.x,         rgb.y,       rgb.z,        math::luma_code(rgb),
          chroma.x, chroma.y,      swept.low,     swept.high};
}

__global__ void evaluate_all(const Sample<float>* samples, Results<float>* results, int count) {
  const int i = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (i < count) results[i] = evaluate(samples[i]);
}

class Random {
 public:
  double uniform(double low, double high) {
    state_ = state_ * 6364136223846793005u + 1442695040888963407u;
    return low + (high - low) * static_cast<double>(state_ >> 11) * 0x1p-53;
  }

 private:
  std::uint64_t state_ = 2;
};

/// Samples in float, so that the double evaluation starts from the very same numbers.
std::vector<Sample<float>> random_samples(int count) {
  Random random;
  const auto camera =
      math::convert<float>(math::make_camera_model(make_camera({}, {1280, 720}, 900.0f)));
  std::vector<Sample<float>> samples(count);
  for (Sample<float>& s : samples) {
    const auto f = [&](double low, double high) {
      return static_cast<float>(random.uniform(low, high));
    };
    s.camera = camera;
    s.mean = {f(-2, 2), f(-2, 2), f(2, 9)};
    s.scale = {std::exp(f(-5, -1)), std::exp(f(-5, -1)), std::exp(f(-5, -1))};
    float norm = 0.0f;
    for (float& q : s.rotation) q = f(-1, 1);
    for (const float q : s.rotation) norm += q * q;
    for (float& q : s.rotation) q /= std::sqrt(norm);
    s.opacity = f(0.05, 0.95);
    for (auto& c : s.sh) c = {f(-0.3, 0.3), f(-0.3, 0.3), f(-0.3, 0.3)};
    s.pixel_px = {f(-2, 2), f(-2, 2)};
  }
  return samples;
}

Sample<double> to_double(const Sample<float>& s) {
  Sample<double> d;
  d.camera = math::convert<double>(s.camera);
  d.mean = math::convert<double>(s.mean);
  d.scale = math::convert<double>(s.scale);
  for (int i = 0; i < 4; ++i) d.rotation[i] = s.rotation[i];
  d.opacity = s.opacity;
  for (int k = 0; k < 16; ++k) d.sh[k] = math::convert<double>(s.sh[k]);
  d.pixel_px = math::convert<double>(s.pixel_px);
  return d;
}

template <class T>
struct DeviceArray {
  explicit DeviceArray(int count) { EXPECT_EQ(cudaMalloc(&data, count * sizeof(T)), cudaSuccess); }
  ~DeviceArray() { cudaFree(data); }
  DeviceArray(const DeviceArray&) = delete;
  DeviceArray& operator=(const DeviceArray&) = delete;
  T* data = nullptr;
};

TEST(CudaParity, FormulasAgreeWithTheHost) {
  int devices = 0;
  const cudaError_t found = cudaGetDeviceCount(&devices);
  if (found != cudaSuccess || devices == 0)
    GTEST_SKIP() << "no CUDA device: " << cudaGetErrorString(found);

  constexpr int count = 20000;
  const std::vector<Sample<float>> samples = random_samples(count);
  DeviceArray<Sample<float>> device_samples(count);
  DeviceArray<Results<float>> device_results(count);
  ASSERT_EQ(cudaMemcpy(device_samples.data, samples.data(), count * sizeof(Sample<float>),
                       cudaMemcpyHostToDevice),
            cudaSuccess);
  evaluate_all<<<(count + 127) / 128, 128>>>(device_samples.data, device_results.data, count);
  std::vector<Results<float>> device(count);
  ASSERT_EQ(cudaMemcpy(device.data(), device_results.data, count * sizeof(Results<float>),
                       cudaMemcpyDeviceToHost),
            cudaSuccess)
      << cudaGetErrorString(cudaGetLastError());

  // Where host floats themselves are off by rounding, the device may be off by as much again.
  for (int i = 0; i < count; ++i) {
    const Results<float> host = evaluate(samples[i]);
    const Results<double> exact = evaluate(to_double(samples[i]));
    for (int r = 0; r < result_count; ++r) {
      const double scale = std::abs(exact.value[r]) + 1.0;
      EXPECT_NEAR(device[i].value[r], host.value[r], 1e-3 * scale) << "sample " << i << ", " << r;
      EXPECT_NEAR(device[i].value[r], exact.value[r], 1e-3 * scale) << "sample " << i << ", " << r;
    }
  }
}

}  // namespace
}  // namespace catgs

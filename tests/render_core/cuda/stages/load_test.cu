// Loading: what kernels read of a scene, against the same bytes unpacked on the host.

#include "render_core/cuda/shade.cuh"
#include "render_core/math/camera-inl.h"
#include "tests/render_core/cuda/stages/stage.h"
#include "tests/render_core/scene/unpack.h"

namespace catgs::cuda::stages {
namespace {

struct Loaded {
  Centre centre;
  math::CovarianceFactor<float> factor;
  math::Vec3<float> colour;
};

__global__ void load_all(SceneArrays scene, math::Vec3<float> from, Loaded* out) {
  const std::uint32_t i = blockIdx.x * blockDim.x + threadIdx.x;
  if (i >= scene.count) return;
  const Centre centre = load_centre(scene, i);
  out[i] = {
      centre, load_factor(scene, i),
      shade(load_sh(scene, i), scene.sh_degree, math::view_direction<float>(from, centre.mean))};
}

/// The colour seen from `from`, in double precision from the packed harmonics.
glm::dvec3 colour_of(const catgs::test::Unpacked& gaussian, int sh_degree, const glm::dvec3& from) {
  const PackedGeometry& g = gaussian.geometry;
  double basis[16] = {};
  math::sh_basis(
      math::view_direction<double>({from.x, from.y, from.z}, {g.mean[0], g.mean[1], g.mean[2]}),
      sh_degree, basis);
  glm::dvec3 sum =
      basis[0] * glm::dvec3(from_half(g.base_red), from_half(g.base_green), from_half(g.base_blue));
  for (std::size_t b = 0; b < gaussian.sh.size(); ++b)
    sum[static_cast<int>(b % 3)] += basis[1 + b / 3] * static_cast<double>(gaussian.sh[b]);
  return {math::colour_from_sh_sum(sum.x), math::colour_from_sh_sum(sum.y),
          math::colour_from_sh_sum(sum.z)};
}

class LoadStage : public StageTest {};

TEST_F(LoadStage, KernelsReadWhatWasPacked) {
  Difference mean("load: centre, world units", 0.0), opacity("load: log2 of opacity", 0.0);
  Difference factor("load: covariance factor", 0.0), colour("load: colour", 1e-5);
  for (int degree = 0; degree <= max_sh_degree; ++degree) {
    const GaussianCloud cloud = catgs::test::random_cloud(3000, degree, 5);
    const StagedScene scene(cloud);
    const SceneArrays& arrays = scene.device.arrays();
    const glm::vec3 from(0.3f, -0.2f, 0.1f);
    DeviceBuffer<Loaded> on_device;
    on_device.reserve(cloud.size());
    load_all<<<(arrays.count + 127) / 128, 128>>>(arrays, {from.x, from.y, from.z},
                                                  on_device.get());
    check_launch("load");
    const std::vector<Loaded> loaded = fetch(on_device.get(), cloud.size());
    const auto blocks = fetch(arrays.blocks, arrays.cluster_count * packed_block_bytes(degree));
    const auto units = fetch(arrays.units, arrays.cluster_count);
    for (std::uint32_t i = 0; i < arrays.count; ++i) {
      const std::size_t cluster = i / cluster_size;
      const catgs::test::Unpacked expected =
          catgs::test::unpack(std::span(blocks).subspan(cluster * packed_block_bytes(degree),
                                                        packed_block_bytes(degree)),
                              units[cluster], degree, static_cast<std::uint32_t>(i % cluster_size));
      const math::Vec3<float>& at = loaded[i].centre.mean;
      const glm::vec3& original = cloud.mean[scene.order[i]];
      for (const float d : {at.x - original.x, at.y - original.y, at.z - original.z}) mean.add(d);
      opacity.add(loaded[i].centre.log2_opacity -
                  unpack_log2_opacity(expected.geometry.log2_opacity));
      const auto &a = loaded[i].factor, &b = expected.factor;
      for (const float d :
           {a.xx - b.xx, a.yx - b.yx, a.yy - b.yy, a.zx - b.zx, a.zy - b.zy, a.zz - b.zz})
        factor.add(d);
      const glm::dvec3 seen = colour_of(expected, degree, from);
      colour.add(loaded[i].colour.x - seen.x);
      colour.add(loaded[i].colour.y - seen.y);
      colour.add(loaded[i].colour.z - seen.z);
    }
  }
}

}  // namespace
}  // namespace catgs::cuda::stages

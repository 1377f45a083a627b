#pragma once

#include <cassert>
#include <cstdint>
#include <span>
#include <vector>

#include <hwy/aligned_allocator.h>

#include "render_core/base/thread_pool.h"
#include "render_core/scene/clusters.h"
#include "render_core/scene/gaussian_cloud.h"

namespace catgs {
namespace math {
// Declared only: SIMD files include the formulas of math/ anew for each instruction set.
template <class T>
struct CovarianceFactor;
}  // namespace math

/// Lanes of the widest SIMD target; the storage is padded and interleaved for it.
inline constexpr std::size_t packet_size = 16;

/// Gaussians laid out for the CPU core: clusters, structure of arrays, covariances factored. N =
/// size() rounded up to whole packets; the padding has opacity 0 and is never visible.
class SceneStore {
 public:
  /// A whole scene, in Morton order.
  SceneStore(const GaussianCloud& cloud, ThreadPool& pool);
  /// Room for clusters that put() fills. Until then their contents are undefined, and take no
  /// physical memory.
  SceneStore(std::size_t clusters, int sh_degree, SplatModel model);

  /// Fills cluster `c` with the first cluster_size Gaussians of `cloud` or less. `factors`: of
  /// their covariances. `first_index`: scene_order() of the first one. Different clusters may be
  /// filled by several threads.
  void put(std::size_t c, const GaussianCloud& cloud,
           std::span<const math::CovarianceFactor<double>> factors, std::uint32_t first_index);

  /// The contents of these clusters are undefined again. Gives their memory back to the system, but
  /// for parts of its pages.
  void forget(std::size_t first_cluster, std::size_t clusters);

  [[nodiscard]] std::size_t size() const { return size_; }
  [[nodiscard]] int sh_degree() const { return sh_degree_; }
  [[nodiscard]] bool antialiased() const { return model_ == SplatModel::antialiased; }
  [[nodiscard]] std::span<const Cluster> clusters() const { return clusters_; }
  [[nodiscard]] std::size_t bytes() const;
  /// Bytes of one cluster.
  [[nodiscard]] static std::size_t cluster_bytes(int sh_degree);

  /// Rows of `attribute_stride()` floats, one per attribute, packet-aligned.
  enum Attribute {
    mean_x,
    mean_y,
    mean_z,  // world units
    factor_xx,
    factor_yx,
    factor_yy,
    factor_zx,
    factor_zy,
    factor_zz,  // CovarianceFactor
    log2_opacity,
    attribute_count
  };
  [[nodiscard]] const float* attribute(Attribute a) const {
    return attributes_.get() + static_cast<std::size_t>(a) * padded_;
  }
  /// Place of each Gaussian in the order of its scene's clusters, modulo 2^32; decides the order of
  /// equal depths.
  [[nodiscard]] const std::uint32_t* scene_order() const { return scene_order_.get(); }
  /// SH of packet p: [coefficient][channel][lane], packet_size lanes.
  [[nodiscard]] const float* sh_of_packet(std::size_t p) const {
    assert(p * packet_size < padded_);
    return sh_.get() + p * sh_floats_per_packet();
  }
  [[nodiscard]] std::size_t sh_floats_per_packet() const {
    return static_cast<std::size_t>(sh_coefficient_count(sh_degree_)) * 3 * packet_size;
  }

 private:
  void allocate();
  void set(std::size_t slot, const GaussianCloud& cloud, std::size_t i,
           const math::CovarianceFactor<double>& factor, std::uint32_t index);
  void pad(std::size_t slot);
  [[nodiscard]] Cluster bound(std::size_t first, std::size_t count) const;

  std::size_t size_;
  std::size_t padded_;
  int sh_degree_;
  SplatModel model_;
  hwy::AlignedFreeUniquePtr<float[]> attributes_;
  hwy::AlignedFreeUniquePtr<std::uint32_t[]> scene_order_;
  hwy::AlignedFreeUniquePtr<float[]> sh_;
  std::vector<Cluster> clusters_;
};

}  // namespace catgs

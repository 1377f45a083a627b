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

/// Lanes of the widest SIMD target; the storage is padded and interleaved for it.
inline constexpr std::size_t packet_size = 16;

/// A GaussianCloud laid out for the CPU core: Morton order, structure of arrays, covariances
/// factored. N = size() rounded up to whole packets; the padding has opacity 0 and is never
/// visible.
class SceneStore {
 public:
  SceneStore(const GaussianCloud& cloud, ThreadPool& pool);

  [[nodiscard]] std::size_t size() const { return size_; }
  [[nodiscard]] int sh_degree() const { return sh_degree_; }
  [[nodiscard]] std::span<const Cluster> clusters() const { return clusters_; }
  [[nodiscard]] std::size_t bytes() const;

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
  /// Index of each Gaussian in the GaussianCloud; decides the order of equal depths.
  [[nodiscard]] const std::uint32_t* original_index() const { return original_index_.get(); }
  /// SH of packet p: [coefficient][channel][lane], packet_size lanes.
  [[nodiscard]] const float* sh_of_packet(std::size_t p) const {
    assert(p * packet_size < padded_);
    return sh_.get() + p * sh_floats_per_packet();
  }
  [[nodiscard]] std::size_t sh_floats_per_packet() const {
    return static_cast<std::size_t>(sh_coefficient_count(sh_degree_)) * 3 * packet_size;
  }

 private:
  void fill_packet(const GaussianCloud& cloud, std::span<const std::uint32_t> order,
                   std::size_t packet);
  [[nodiscard]] Cluster bound(std::size_t cluster) const;

  std::size_t size_;
  std::size_t padded_;
  int sh_degree_;
  hwy::AlignedFreeUniquePtr<float[]> attributes_;
  hwy::AlignedFreeUniquePtr<std::uint32_t[]> original_index_;
  hwy::AlignedFreeUniquePtr<float[]> sh_;
  std::vector<Cluster> clusters_;
};

}  // namespace catgs

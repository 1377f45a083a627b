#include "render_core/cpu/scene_store.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "render_core/math/projection-inl.h"

namespace catgs {
SceneStore::SceneStore(const GaussianCloud& cloud, ThreadPool& pool)
    : size_(cloud.size()),
      padded_((cloud.size() + packet_size - 1) / packet_size * packet_size),
      sh_degree_(cloud.sh_degree) {
  const std::size_t packets = padded_ / packet_size;
  attributes_ = hwy::AllocateAligned<float>(std::max<std::size_t>(1, padded_ * attribute_count));
  original_index_ = hwy::AllocateAligned<std::uint32_t>(std::max<std::size_t>(1, padded_));
  sh_ = hwy::AllocateAligned<float>(std::max<std::size_t>(1, packets * sh_floats_per_packet()));
  if (!attributes_ || !original_index_ || !sh_) throw std::bad_alloc();

  const std::vector<std::uint32_t> order = morton_order(cloud.mean, pool);
  clusters_.resize(clusters_of(size_));
  pool.parallel_for(clusters_.size(), [&](std::size_t c) {
    constexpr std::size_t packets_per_cluster = cluster_size / packet_size;
    const std::size_t end = std::min(packets, (c + 1) * packets_per_cluster);
    for (std::size_t p = c * packets_per_cluster; p < end; ++p) fill_packet(cloud, order, p);
    clusters_[c] = bound(c);
  });
}

std::size_t SceneStore::bytes() const {
  return padded_ * (attribute_count * sizeof(float) + sizeof(std::uint32_t)) +
         padded_ / packet_size * sh_floats_per_packet() * sizeof(float) +
         clusters_.size() * sizeof(Cluster);
}

void SceneStore::fill_packet(const GaussianCloud& cloud, std::span<const std::uint32_t> order,
                             std::size_t packet) {
  const int sh_count = sh_coefficient_count(sh_degree_);
  float* const sh = sh_.get() + packet * sh_floats_per_packet();
  for (std::size_t lane = 0; lane < packet_size; ++lane) {
    const std::size_t slot = packet * packet_size + lane;
    const bool padding = slot >= size_;
    const std::uint32_t i = order[padding ? size_ - 1 : slot];
    const glm::vec3& mean = cloud.mean[i];
    const glm::vec3& scale = cloud.scale[i];
    const glm::dquat q = glm::normalize(glm::dquat(cloud.rotation[i]));
    const double rotation[4] = {q.x, q.y, q.z, q.w};
    const auto l = math::covariance_factor(rotation, math::Vec3<double>{scale.x, scale.y, scale.z});
    const double opacity = padding ? 0.0 : static_cast<double>(cloud.opacity[i]);
    const std::array<double, attribute_count> values = {
        mean.x, mean.y, mean.z, l.xx, l.yx, l.yy, l.zx, l.zy, l.zz, std::log2(opacity)};
    for (std::size_t a = 0; a < attribute_count; ++a)
      attributes_[a * padded_ + slot] = static_cast<float>(values[a]);
    original_index_[slot] = i;
    for (int k = 0; k < sh_count; ++k)
      for (int channel = 0; channel < 3; ++channel)
        sh[(static_cast<std::size_t>(k) * 3 + channel) * packet_size + lane] =
            cloud.sh_of(i)[k][channel];
  }
}

Cluster SceneStore::bound(std::size_t cluster) const {
  ClusterBounds bounds;
  const std::size_t end = std::min(size_, (cluster + 1) * cluster_size);
  for (std::size_t i = cluster * cluster_size; i < end; ++i) {
    // The Frobenius norm of the factor bounds the largest standard deviation.
    double variance = 0.0;
    for (const Attribute a : {factor_xx, factor_yx, factor_yy, factor_zx, factor_zy, factor_zz})
      variance += std::pow(static_cast<double>(attribute(a)[i]), 2);
    bounds.add({attribute(mean_x)[i], attribute(mean_y)[i], attribute(mean_z)[i]},
               std::sqrt(variance), attribute(log2_opacity)[i]);
  }
  return bounds.cluster();
}

}  // namespace catgs

#include "render_core/cpu/scene_store.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <limits>

#include <sys/mman.h>
#include <unistd.h>

#include "render_core/math/projection-inl.h"

namespace catgs {
namespace {

std::size_t packet_bytes(int sh_degree) {
  const auto sh_floats = static_cast<std::size_t>(3 * sh_coefficient_count(sh_degree));
  return packet_size *
         ((SceneStore::attribute_count + sh_floats) * sizeof(float) + sizeof(std::uint32_t));
}

/// Tells the system about those of its pages that lie within an array.
template <class T>
void advise(T* first, std::size_t count, int advice) {
  static const auto page = static_cast<std::uintptr_t>(::sysconf(_SC_PAGESIZE));
  const auto begin = (reinterpret_cast<std::uintptr_t>(first) + page - 1) / page * page;
  const auto end = reinterpret_cast<std::uintptr_t>(first + count) / page * page;
  if (begin < end) (void)::madvise(reinterpret_cast<void*>(begin), end - begin, advice);
}

template <class T>
void give_back(T* first, std::size_t count) {
  advise(first, count, MADV_DONTNEED);
}

template <class T>
void use_small_pages(T* first, std::size_t count) {
  advise(first, count, MADV_NOHUGEPAGE);
}

}  // namespace

SceneStore::SceneStore(const GaussianCloud& cloud, ThreadPool& pool)
    : size_(cloud.size()),
      padded_((cloud.size() + packet_size - 1) / packet_size * packet_size),
      sh_degree_(cloud.sh_degree),
      model_(cloud.model) {
  allocate();
  const std::vector<std::uint32_t> order = morton_order(cloud.mean, pool);
  pool.parallel_for(clusters_.size(), [&](std::size_t c) {
    const std::size_t first = c * cluster_size, end = std::min(size_, first + cluster_size);
    for (std::size_t slot = first; slot < end; ++slot) {
      const std::uint32_t i = order[slot];
      const glm::vec3& scale = cloud.scale[i];
      const glm::dquat q = glm::normalize(glm::dquat(cloud.rotation[i]));
      const double rotation[4] = {q.x, q.y, q.z, q.w};
      set(slot, cloud, i,
          math::covariance_factor(rotation, math::Vec3<double>{scale.x, scale.y, scale.z}),
          static_cast<std::uint32_t>(slot));
    }
    for (std::size_t slot = end; slot < std::min(padded_, first + cluster_size); ++slot) pad(slot);
    clusters_[c] = bound(first, end - first);
  });
}

SceneStore::SceneStore(std::size_t clusters, int sh_degree, SplatModel model)
    : size_(clusters * cluster_size), padded_(size_), sh_degree_(sh_degree), model_(model) {
  allocate();
  // A huge page would take memory for the clusters of other slots.
  use_small_pages(attributes_.get(), attribute_count * padded_);
  use_small_pages(scene_order_.get(), padded_);
  use_small_pages(sh_.get(), padded_ / packet_size * sh_floats_per_packet());
}

void SceneStore::allocate() {
  attributes_ = hwy::AllocateAligned<float>(std::max<std::size_t>(1, padded_ * attribute_count));
  scene_order_ = hwy::AllocateAligned<std::uint32_t>(std::max<std::size_t>(1, padded_));
  sh_ = hwy::AllocateAligned<float>(
      std::max<std::size_t>(1, padded_ / packet_size * sh_floats_per_packet()));
  if (!attributes_ || !scene_order_ || !sh_) throw std::bad_alloc();
  clusters_.resize(clusters_of(size_));
}

void SceneStore::put(std::size_t c, const GaussianCloud& cloud,
                     std::span<const math::CovarianceFactor<double>> factors,
                     std::uint32_t first_index) {
  assert(c < clusters_.size() && !factors.empty() && factors.size() <= cluster_size);
  const std::size_t first = c * cluster_size;
  for (std::size_t i = 0; i < factors.size(); ++i)
    set(first + i, cloud, i, factors[i], first_index + static_cast<std::uint32_t>(i));
  for (std::size_t slot = first + factors.size(); slot < first + cluster_size; ++slot) pad(slot);
  clusters_[c] = bound(first, factors.size());
}

void SceneStore::forget(std::size_t first_cluster, std::size_t clusters) {
  const std::size_t first = first_cluster * cluster_size, count = clusters * cluster_size;
  assert(first + count <= padded_);
  for (std::size_t a = 0; a < attribute_count; ++a)
    give_back(attributes_.get() + a * padded_ + first, count);
  give_back(scene_order_.get() + first, count);
  give_back(sh_.get() + first / packet_size * sh_floats_per_packet(),
            count / packet_size * sh_floats_per_packet());
}

std::size_t SceneStore::bytes() const {
  return padded_ / packet_size * packet_bytes(sh_degree_) + clusters_.size() * sizeof(Cluster);
}

std::size_t SceneStore::cluster_bytes(int sh_degree) {
  return cluster_size / packet_size * packet_bytes(sh_degree) + sizeof(Cluster);
}

void SceneStore::set(std::size_t slot, const GaussianCloud& cloud, std::size_t i,
                     const math::CovarianceFactor<double>& factor, std::uint32_t index) {
  const glm::vec3& mean = cloud.mean[i];
  const std::array<double, attribute_count> values = {
      mean.x,    mean.y,    mean.z,    factor.xx, factor.yx,
      factor.yy, factor.zx, factor.zy, factor.zz, std::log2(static_cast<double>(cloud.opacity[i]))};
  for (std::size_t a = 0; a < attribute_count; ++a)
    attributes_[a * padded_ + slot] = static_cast<float>(values[a]);
  scene_order_[slot] = index;
  float* const sh = sh_.get() + slot / packet_size * sh_floats_per_packet() + slot % packet_size;
  const int sh_count = sh_coefficient_count(sh_degree_);
  for (int k = 0; k < sh_count; ++k)
    for (int channel = 0; channel < 3; ++channel)
      sh[(static_cast<std::size_t>(k) * 3 + channel) * packet_size] = cloud.sh_of(i)[k][channel];
}

/// The last Gaussian before the slot again, with opacity 0.
void SceneStore::pad(std::size_t slot) {
  for (std::size_t a = 0; a < attribute_count; ++a)
    attributes_[a * padded_ + slot] = attributes_[a * padded_ + slot - 1];
  attributes_[log2_opacity * padded_ + slot] = -std::numeric_limits<float>::infinity();
  scene_order_[slot] = scene_order_[slot - 1];
}

Cluster SceneStore::bound(std::size_t first, std::size_t count) const {
  ClusterBounds bounds;
  for (std::size_t i = first; i < first + count; ++i) {
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

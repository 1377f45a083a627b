#include "render_core/cpu/scene_store.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "render_core/cpu/radix_sort.h"
#include "render_core/math/camera-inl.h"
#include "render_core/math/constants.h"
#include "render_core/math/ellipse-inl.h"
#include "render_core/math/projection-inl.h"

namespace catgs {
namespace {

/// Spreads the low 21 bits of `v` to every third bit.
std::uint64_t spread_bits(std::uint64_t v) {
  v &= 0x1fffff;
  v = (v | v << 32) & 0x1f00000000ffff;
  v = (v | v << 16) & 0x1f0000ff0000ff;
  v = (v | v << 8) & 0x100f00f00f00f00f;
  v = (v | v << 4) & 0x10c30c30c30c30c3;
  v = (v | v << 2) & 0x1249249249249249;
  return v;
}

/// Indices of the cloud's Gaussians along a Morton curve; equal codes keep their order.
std::vector<std::uint32_t> morton_order(const GaussianCloud& cloud, ThreadPool& pool) {
  glm::vec3 low(std::numeric_limits<float>::max()), high(std::numeric_limits<float>::lowest());
  for (const glm::vec3& mean : cloud.mean) {
    low = glm::min(low, mean);
    high = glm::max(high, mean);
  }
  constexpr double cells = 1 << 21;
  const glm::dvec3 scale = (cells - 1.0) / glm::max(glm::dvec3(high) - glm::dvec3(low), 1e-30);

  std::vector<CodedIndex> codes(cloud.size()), scratch(cloud.size());
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const glm::dvec3 cell = (glm::dvec3(cloud.mean[i]) - glm::dvec3(low)) * scale;
    codes[i] = {spread_bits(static_cast<std::uint64_t>(cell.x)) |
                    spread_bits(static_cast<std::uint64_t>(cell.y)) << 1 |
                    spread_bits(static_cast<std::uint64_t>(cell.z)) << 2,
                static_cast<std::uint32_t>(i)};
  }
  RadixSorter sorter;
  sorter.sort(codes, scratch, 63, pool);
  std::vector<std::uint32_t> order(cloud.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = codes[i].value;
  return order;
}

}  // namespace

SceneStore::SceneStore(const GaussianCloud& cloud, ThreadPool& pool)
    : size_(cloud.size()),
      padded_((cloud.size() + packet_size - 1) / packet_size * packet_size),
      sh_degree_(cloud.sh_degree) {
  const std::size_t packets = padded_ / packet_size;
  attributes_ = hwy::AllocateAligned<float>(std::max<std::size_t>(1, padded_ * attribute_count));
  original_index_ = hwy::AllocateAligned<std::uint32_t>(std::max<std::size_t>(1, padded_));
  sh_ = hwy::AllocateAligned<float>(std::max<std::size_t>(1, packets * sh_floats_per_packet()));
  if (!attributes_ || !original_index_ || !sh_) throw std::bad_alloc();

  const std::vector<std::uint32_t> order = morton_order(cloud, pool);
  clusters_.resize((size_ + cluster_size - 1) / cluster_size);
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
  glm::vec3 low(std::numeric_limits<float>::max()), high(std::numeric_limits<float>::lowest());
  double reach = 0.0;
  const std::size_t end = std::min(size_, (cluster + 1) * cluster_size);
  for (std::size_t i = cluster * cluster_size; i < end; ++i) {
    const glm::vec3 mean(attribute(mean_x)[i], attribute(mean_y)[i], attribute(mean_z)[i]);
    low = glm::min(low, mean);
    high = glm::max(high, mean);
    // The Frobenius norm of the factor bounds the largest standard deviation.
    double variance = 0.0;
    for (const Attribute a : {factor_xx, factor_yx, factor_yy, factor_zx, factor_zy, factor_zz})
      variance += std::pow(static_cast<double>(attribute(a)[i]), 2);
    const double squared_sigmas = math::reach_of(static_cast<double>(attribute(log2_opacity)[i])) /
                                  (exponent_scale * exponent_scale);
    reach = std::max(reach, std::sqrt(std::max(0.0, squared_sigmas) * variance));
  }
  const glm::vec3 centre = 0.5f * (low + high);
  // Rounded outwards.
  const glm::vec3 half = glm::max(high - centre, centre - low) * (1.0f + 1e-6f);
  return {centre, half, static_cast<float>(reach) * (1.0f + 1e-6f)};
}

// A Gaussian at view coordinates (x, y, z), z > near, covers columns up to
//   f x / z + c + k sqrt(low_pass + (f / z)^2 (1 + s^2) sigma^2),
// with k its extent in standard deviations, sigma its largest one and s the clamped slope. Since
// sqrt(a + b) <= sqrt(a) + sqrt(b), it stays left of the first pixel centre when
//   f x + (c + k_max sqrt(low_pass) - 0.5) z + f sqrt(1 + s_max^2) k sigma < 0:
// a half-space moved by the Gaussian's reach k sigma. Likewise for the other sides.
ClusterCuller::ClusterCuller(const Camera& camera) {
  const auto model = math::make_camera_model(camera);
  const auto vec3 = [](const math::Vec3<double>& v) { return glm::dvec3(v.x, v.y, v.z); };
  const glm::dvec3 right = vec3(model.right), down = vec3(model.down),
                   forward = vec3(model.forward);
  const double blur = std::sqrt(-2.0 * std::log(alpha_min)) * std::sqrt(low_pass_px2);
  const double slack = blur - 0.5 + 0.01;  // px; the last term covers rounding
  const glm::dvec2 size(camera.size_px);

  const auto half_space = [&](const glm::dvec3& normal, double reach_factor, double offset) {
    return HalfSpace{glm::vec3(normal),
                     static_cast<float>(offset - glm::dot(normal, vec3(model.position))),
                     static_cast<float>(reach_factor)};
  };
  const auto side = [&](const glm::dvec3& axis, double focal, double from_edge, double slope) {
    const glm::dvec3 normal = (axis * focal + forward * (from_edge + slack)) / focal;
    return half_space(normal, std::sqrt(1.0 + slope * slope), 0.0);
  };
  const auto steepest = [](double a, double b) { return std::max(std::abs(a), std::abs(b)); };
  const double slope_x = steepest(model.slope_min.x, model.slope_max.x);
  const double slope_y = steepest(model.slope_min.y, model.slope_max.y);
  const auto& f = model.focal_px;
  const auto& c = model.principal_point_px;
  half_spaces_[0] = half_space(forward, 0.0, -static_cast<double>(camera.near_z));
  half_spaces_[1] = side(right, f.x, c.x, slope_x);
  half_spaces_[2] = side(-right, f.x, size.x - c.x, slope_x);
  half_spaces_[3] = side(down, f.y, c.y, slope_y);
  half_spaces_[4] = side(-down, f.y, size.y - c.y, slope_y);
}

unsigned ClusterCuller::beyond(const Cluster& cluster) const {
  unsigned beyond = 0;
  for (unsigned i = 0; i < std::size(half_spaces_); ++i) {
    const HalfSpace& h = half_spaces_[i];
    const float centre = glm::dot(h.normal, cluster.centre) + h.offset;
    const float radius = glm::dot(glm::abs(h.normal), cluster.half_extent);
    const float rounding = 1e-5f * (std::abs(h.offset) + std::abs(centre));
    if (centre + radius + h.reach_factor * cluster.reach + rounding < 0.0f) beyond |= 1u << i;
  }
  return beyond;
}

}  // namespace catgs

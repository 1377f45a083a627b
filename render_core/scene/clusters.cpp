#include "render_core/scene/clusters.h"

#include <algorithm>
#include <cassert>
#include <cmath>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "render_core/base/radix_sort.h"
#include "render_core/math/camera-inl.h"
#include "render_core/math/constants.h"
#include "render_core/math/ellipse-inl.h"

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

}  // namespace

MortonCurve::MortonCurve(const glm::vec3& low, const glm::vec3& high) : low_(low) {
  constexpr double cells = 1 << 21;
  cells_per_unit_ = (cells - 1.0) / glm::max(glm::dvec3(high) - low_, 1e-30);
}

std::uint64_t MortonCurve::code(const glm::vec3& point) const {
  const glm::dvec3 cell = (glm::dvec3(point) - low_) * cells_per_unit_;
  return spread_bits(static_cast<std::uint64_t>(cell.x)) |
         spread_bits(static_cast<std::uint64_t>(cell.y)) << 1 |
         spread_bits(static_cast<std::uint64_t>(cell.z)) << 2;
}

std::vector<std::uint32_t> morton_order(std::span<const glm::vec3> positions, ThreadPool& pool) {
  glm::vec3 low(std::numeric_limits<float>::max()), high(std::numeric_limits<float>::lowest());
  for (const glm::vec3& point : positions) {
    low = glm::min(low, point);
    high = glm::max(high, point);
  }
  const MortonCurve curve(low, high);
  std::vector<CodedIndex> codes(positions.size()), scratch(positions.size());
  for (std::size_t i = 0; i < positions.size(); ++i)
    codes[i] = {curve.code(positions[i]), static_cast<std::uint32_t>(i)};
  RadixSorter sorter;
  sorter.sort(codes, scratch, 63, pool);
  std::vector<std::uint32_t> order(positions.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = codes[i].value;
  return order;
}

void ClusterBounds::add(const glm::vec3& mean, double sigma, float log2_opacity) {
  low_ = glm::min(low_, mean);
  high_ = glm::max(high_, mean);
  const double squared_sigmas =
      math::reach_of(static_cast<double>(log2_opacity)) / (exponent_scale * exponent_scale);
  reach_ = std::max(reach_, std::sqrt(std::max(0.0, squared_sigmas)) * sigma);
}

Cluster ClusterBounds::cluster() const {
  assert(low_.x <= high_.x);
  const glm::vec3 centre = 0.5f * (low_ + high_);
  // Rounded outwards.
  const glm::vec3 half = glm::max(high_ - centre, centre - low_) * (1.0f + 1e-6f);
  return {centre, half, static_cast<float>(reach_) * (1.0f + 1e-6f)};
}

// A Gaussian at view coordinates (x, y, z), z > near, covers columns up to
//   f x / z + c + k sqrt(low_pass + (f / z)^2 (1 + s^2) sigma^2),
// with k its extent in standard deviations, sigma its largest one and s the clamped slope. Since
// sqrt(a + b) <= sqrt(a) + sqrt(b), it stays left of the first pixel centre when
//   f x + (c + k_max sqrt(low_pass) - 0.5) z + f sqrt(1 + s_max^2) k sigma < 0:
// a half-space moved by the Gaussian's reach k sigma. Likewise for the other sides. Where rays are
// parallel, 1 stands in place of z, and s is 0.
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
    const double edge = (from_edge + slack) / focal, steepness = model.z_weight * slope;
    return half_space(axis + forward * (model.z_weight * edge),
                      std::sqrt(1.0 + steepness * steepness), model.z_offset * edge);
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
  const ClipBox& clip = camera.clip;
  for (int i = 0; i < 3; ++i) {
    if (std::isfinite(clip.low[i])) half_spaces_[count_++] = {clip.axes[i], -clip.low[i], 0.0f};
    if (std::isfinite(clip.high[i])) half_spaces_[count_++] = {-clip.axes[i], clip.high[i], 0.0f};
  }
}

bool ClusterCuller::within(const Cluster& cluster) const {
  return std::ranges::all_of(std::span(half_spaces_).first(count_), [&](const HalfSpace& h) {
    const float centre = glm::dot(h.normal, cluster.centre) + h.offset;
    return centre >= glm::dot(glm::abs(h.normal), cluster.half_extent);
  });
}

}  // namespace catgs

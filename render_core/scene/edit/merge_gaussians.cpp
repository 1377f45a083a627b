#include "render_core/scene/edit/merge_gaussians.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cassert>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "render_core/base/radix_sort.h"
#include "render_core/math/constants.h"
#include "render_core/scene/activations.h"
#include "render_core/scene/clusters.h"
#include "render_core/scene/covariance.h"
#include "render_core/scene/keep_if.h"
#include "render_core/scene/packed_gaussian.h"

namespace catgs {
namespace {

constexpr std::size_t next_on_curve = 32, compared = 4;
constexpr double most_of_a_round = 0.45;
constexpr float ground_squared = 0.1f;
constexpr std::size_t block = 4096;     // of Gaussians, a thread's piece of work
constexpr double least_weight = 1e-30;  // a needle or a point has no area, but still a place

/// A Gaussian as the cost sees it. The unit of length is the mean size in the scene.
struct MergedSplat {
  glm::vec3 mean{0.0f};
  Covariance<float> shape;
  float opacity = 0.0f, weight = 0.0f, size = 0.0f;
  float power = 0.0f;  // product() with itself
  glm::vec3 colour{0.0f};
};

/// A covariance projected along an axis.
struct Flat {
  float xx, xy, yy;
  [[nodiscard]] float determinant() const { return std::max(xx * yy - xy * xy, 0.0f); }
};

/// Integral of two Gaussians of peak 1 whose centres are (x, y) apart, but for a factor of 2 pi.
float flat_product(const Flat& a, const Flat& b, float x, float y) {
  const Flat sum{a.xx + b.xx, a.xy + b.xy, a.yy + b.yy};
  const float determinant = sum.determinant();
  if (!(determinant > 0.0f)) return 0.0f;
  const float q = (sum.yy * x * x - 2.0f * sum.xy * x * y + sum.xx * y * y) / determinant;
  if (!(q < 40.0f)) return 0.0f;
  return std::sqrt(a.determinant() * (b.determinant() / determinant)) * std::exp(-0.5f * q);
}

/// Integral of the product of two Gaussians with their opacities, mean of the views along the three
/// axes, but for a factor of pi.
float product(const MergedSplat& a, const MergedSplat& b) {
  const Covariance<float>&p = a.shape, &q = b.shape;
  const glm::vec3 d = a.mean - b.mean;
  const float sum = flat_product({p.xx, p.xy, p.yy}, {q.xx, q.xy, q.yy}, d.x, d.y) +
                    flat_product({p.xx, p.xz, p.zz}, {q.xx, q.xz, q.zz}, d.x, d.z) +
                    flat_product({p.yy, p.yz, p.zz}, {q.yy, q.yz, q.zz}, d.y, d.z);
  return 2.0f / 3.0f * a.opacity * b.opacity * sum;
}

float opacity_of(double weight, double area) {
  return std::clamp(static_cast<float>(weight / std::max(area, least_weight)),
                    static_cast<float>(alpha_min), max_opacity);
}

MergedSplat joined(const MergedSplat& a, const MergedSplat& b) {
  const float weight = a.weight + b.weight, share = b.weight / weight;
  const glm::vec3 d = b.mean - a.mean;
  MergedSplat m;
  m.mean = a.mean + share * d;
  m.shape.add(1.0f - share, a.shape);
  m.shape.add(share, b.shape);
  m.shape.add(share * (1.0f - share), outer(d));
  m.opacity = opacity_of(weight, m.shape.area());
  m.colour = a.colour + share * (b.colour - a.colour);
  return m;
}

/// The error E of a pair, but for a factor of pi.
float error_of(const MergedSplat& a, const MergedSplat& b) {
  const MergedSplat m = joined(a, b);
  const auto likeness = [](const MergedSplat& i, const MergedSplat& j) {
    return static_cast<double>(glm::dot(i.colour, j.colour) + ground_squared);
  };
  const auto cross = [&](const MergedSplat& i, const MergedSplat& j) {
    return likeness(i, j) * product(i, j);
  };
  const double error = likeness(a, a) * a.power + likeness(b, b) * b.power + cross(m, m) +
                       2.0 * (cross(a, b) - cross(a, m) - cross(b, m));
  // A value that is no number counts as the largest one, so that every pair can be joined at last.
  constexpr double largest = std::numeric_limits<float>::max();
  return error < largest ? static_cast<float>(std::max(error, 0.0))
                         : std::numeric_limits<float>::max();
}

/// The cost of merge_nodes.h, relative to the sizes of the two.
float cost_of(const MergedSplat& a, const MergedSplat& b) {
  const glm::vec3 d = b.mean - a.mean, colours = b.colour - a.colour;
  const float larger = b.size - a.size;
  const float square = 0.5f * (a.size * a.size + b.size * b.size) + 1e-30f;
  return (glm::dot(d, d) + larger * larger) / square +
         colour_reach * colour_reach * glm::dot(colours, colours);
}

struct Partner {
  float error = 0.0f;
  std::uint32_t position = 0;  // along the curve
};

struct Pair {
  std::uint32_t from, to;  // in the cloud
};

/// One round of joining.
class Round {
 public:
  Round(GaussianCloud& cloud, ThreadPool& pool);
  /// Joins 1 to `most` pairs.
  void join_cheapest(std::size_t most);

 private:
  template <class Body>
  void for_each(std::size_t count, const Body& body) {
    pool_.parallel_for((count + block - 1) / block, [&](std::size_t part) {
      for (std::size_t i = part * block; i < std::min(count, (part + 1) * block); ++i) body(i);
    });
  }
  [[nodiscard]] Partner partner_of(std::size_t position) const;
  [[nodiscard]] std::vector<Pair> cheapest_pairs(std::size_t most);
  void join(const Pair& pair);

  GaussianCloud& cloud_;
  ThreadPool& pool_;
  std::vector<std::uint32_t> order_;  // along the curve
  std::vector<MergedSplat> splats_;   // in that order
};

Round::Round(GaussianCloud& cloud, ThreadPool& pool)
    : cloud_(cloud), pool_(pool), order_(morton_order(cloud.mean, pool)), splats_(cloud.size()) {
  const auto count = static_cast<double>(cloud.size());
  double size = 0.0;
  glm::dvec3 middle(0.0);
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    size += glm::length(glm::dvec3(cloud.scale[i])) / count;
    middle += glm::dvec3(cloud.mean[i]) / count;
  }
  const double unit = std::max(size, 1e-30);
  for_each(cloud.size(), [&](std::size_t position) {
    const std::uint32_t i = order_[position];
    const glm::quat& q = cloud_.rotation[i];
    const float rotation[4] = {q.x, q.y, q.z, q.w};
    const glm::vec3 scale(glm::dvec3(cloud_.scale[i]) / unit);
    MergedSplat& splat = splats_[position];
    splat.mean = glm::vec3((glm::dvec3(cloud_.mean[i]) - middle) / unit);
    splat.shape =
        covariance_of(math::covariance_factor<float>(rotation, {scale.x, scale.y, scale.z}));
    splat.opacity = cloud_.opacity[i];
    splat.weight = std::max(splat.opacity * splat.shape.area(), static_cast<float>(least_weight));
    splat.size = std::sqrt(splat.shape.trace() / 3.0f);
    splat.power = product(splat, splat);
    splat.colour = 0.5f + sh_c0 * *cloud_.sh_of(i);
  });
}

Partner Round::partner_of(std::size_t position) const {
  const MergedSplat& splat = splats_[position];
  std::array<std::pair<float, std::uint32_t>, compared> best;
  best.fill({std::numeric_limits<float>::infinity(), 0});
  const std::size_t end = std::min(splats_.size(), position + 1 + next_on_curve);
  for (std::size_t other = position + 1; other < end; ++other) {
    const float cost = cost_of(splat, splats_[other]);
    if (!(cost < best.back().first)) continue;
    best.back() = {cost, static_cast<std::uint32_t>(other)};
    for (std::size_t k = compared - 1; k > 0 && best[k].first < best[k - 1].first; --k)
      std::swap(best[k], best[k - 1]);
  }
  Partner partner{std::numeric_limits<float>::max(), static_cast<std::uint32_t>(position + 1)};
  for (const auto& [cost, other] : best) {
    if (cost == std::numeric_limits<float>::infinity()) break;
    const float error = error_of(splat, splats_[other]);
    if (error < partner.error) partner = {error, other};
  }
  return partner;
}

std::vector<Pair> Round::cheapest_pairs(std::size_t most) {
  const std::size_t count = splats_.size() - 1;  // the last one has none after it
  std::vector<Partner> partners(count);
  for_each(count, [&](std::size_t position) { partners[position] = partner_of(position); });
  std::vector<CodedIndex> by_error(count), scratch(count);
  // Floats that are not negative compare as their bits do.
  for (std::size_t position = 0; position < count; ++position)
    by_error[position] = {std::bit_cast<std::uint32_t>(partners[position].error),
                          static_cast<std::uint32_t>(position)};
  RadixSorter().sort(by_error, scratch, 32, pool_);
  std::vector<bool> taken(splats_.size());
  std::vector<Pair> pairs;
  for (const CodedIndex& next : by_error) {
    if (pairs.size() == most) break;
    const std::uint32_t other = partners[next.value].position;
    if (taken[next.value] || taken[other]) continue;
    taken[next.value] = taken[other] = true;
    pairs.push_back({order_[next.value], order_[other]});
  }
  return pairs;
}

void Round::join(const Pair& pair) {
  const auto covariance = [&](std::uint32_t i) {
    const glm::quat& q = cloud_.rotation[i];
    const glm::dvec3 scale(cloud_.scale[i]);
    const double rotation[4] = {q.x, q.y, q.z, q.w};
    return covariance_of(math::covariance_factor<double>(rotation, {scale.x, scale.y, scale.z}));
  };
  const auto [from, to] = pair;
  const Covariance<double> a = covariance(from), b = covariance(to);
  const double weight_a = std::max(cloud_.opacity[from] * a.area(), least_weight);
  const double weight_b = std::max(cloud_.opacity[to] * b.area(), least_weight);
  const double share = weight_b / (weight_a + weight_b);
  const glm::dvec3 mean(cloud_.mean[from]), d = glm::dvec3(cloud_.mean[to]) - mean;
  Covariance<double> sum;
  sum.add(1.0 - share, a);
  sum.add(share, b);
  sum.add(share * (1.0 - share), outer(d));
  auto [turn, scale] = axes_of(factor_of(sum));
  // The last axis is the shortest one, as surfels need it: their normal.
  while (scale.z > std::min(scale.x, scale.y)) {
    turn = turn * glm::quat(0.5f, 0.5f, 0.5f, 0.5f);  // x to y to z to x
    scale = {scale.y, scale.z, scale.x};
  }
  cloud_.mean[to] = glm::vec3(mean + share * d);
  cloud_.rotation[to] = turn;
  cloud_.scale[to] = glm::max(scale, glm::vec3(1e-10f));  // as sanitize() has it
  cloud_.opacity[to] = opacity_of(weight_a + weight_b, sum.area());
  const auto sh_count = static_cast<std::size_t>(cloud_.sh_count());
  for (std::size_t k = 0; k < sh_count; ++k) {
    const glm::vec3& sh = cloud_.sh[from * sh_count + k];
    glm::vec3& into = cloud_.sh[to * sh_count + k];
    into = sh + static_cast<float>(share) * (into - sh);
  }
}

void Round::join_cheapest(std::size_t most) {
  const std::vector<Pair> pairs = cheapest_pairs(most);
  for_each(pairs.size(), [&](std::size_t i) { join(pairs[i]); });
  std::vector<bool> gone(cloud_.size());
  for (const Pair& pair : pairs) gone[pair.from] = true;
  keep_if(cloud_, [&](std::size_t i) { return !gone[i]; });
}

}  // namespace

void merge_gaussians(GaussianCloud& cloud, std::size_t wanted, ThreadPool& pool,
                     const LoadContext& context) {
  assert(wanted >= 1);
  const std::size_t before = cloud.size();
  while (cloud.size() > wanted) {
    const auto share = most_of_a_round * static_cast<double>(cloud.size());
    Round(cloud, pool)
        .join_cheapest(std::min(cloud.size() - wanted, static_cast<std::size_t>(std::ceil(share))));
    // Rounds get shorter as the cloud does.
    context.report(static_cast<double>(before - cloud.size()) /
                   static_cast<double>(before - wanted));
  }
}

}  // namespace catgs

#include "render_core/scene/tree/merge_nodes.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cassert>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>
#include <utility>
#include <vector>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "render_core/math/constants.h"
#include "render_core/scene/activations.h"
#include "render_core/scene/covariance.h"

namespace catgs {
namespace {

using Factor = math::CovarianceFactor<double>;

constexpr int most_members = 2 * static_cast<int>(cluster_size);
/// Bounds how a covariance grows. Moments of a closed surface make Gaussians that are too small to
/// close it, and the sum of areas that hide each other is too large. On playbot, in a pool for a
/// third of it, a picture has 33.5 dB without growth, and 34.5, 34.2 dB with at most 1.5, 1.8; on a
/// city of 400,000 in a pool for a quarter 17.9, 22.5, 22.3 dB.
constexpr double most_grown = 1.5;
constexpr float too_far = 1e18f;  // for any partner, in mean sizes

/// The Gaussians of the children.
struct Members {
  explicit Members(std::span<const NodeView> children, int degree) {
    std::size_t count = 0;
    for (const NodeView& child : children) count += child.facts.count;
    cloud.resize(count, degree);
    factors.resize(count);
    std::size_t first = 0;
    for (const NodeView& child : children) {
      unpack_cluster(child.block, child.facts.units, child.facts.count, cloud, first,
                     std::span(factors).subspan(first, child.facts.count));
      first += child.facts.count;
    }
    for (std::size_t i = 0; i < count; ++i) {
      covariances.push_back(covariance_of(factors[i]));
      // A needle or a point has no area, but still a place.
      weights.push_back(std::max(cloud.opacity[i] * covariances[i].area(), 1e-30));
    }
  }
  [[nodiscard]] int size() const { return static_cast<int>(cloud.size()); }

  GaussianCloud cloud;  // without rotations and scales
  std::vector<Factor> factors;
  std::vector<Covariance<double>> covariances;
  std::vector<double> weights;
};

double quantile(std::vector<double>& values, double share) {
  const auto at =
      static_cast<std::ptrdiff_t>(std::ceil(share * static_cast<double>(values.size())));
  const auto nth = values.begin() + std::max<std::ptrdiff_t>(at - 1, 0);
  std::nth_element(values.begin(), nth, values.end());
  return *nth;
}

/// Joins the cheapest pair of groups again and again.
///
/// Each group keeps the cheapest partner that it found when it last searched. Groups only vanish or
/// become new ones, and a new group searches at once. So the cost that a group keeps stays a lower
/// bound of its pairs with older groups. The group with the least bound searches again if its
/// partner has changed since (Müllner, "Modern hierarchical, agglomerative clustering algorithms",
/// 2011). A search leaves out the blocks of groups that are too far away.
class Grouping {
 public:
  explicit Grouping(const Members& members);
  void join_until(int groups);
  /// The group of each member: the index of one of the group's members.
  [[nodiscard]] int group_of(int member) const {
    while (joined_[member] != member) member = joined_[member];
    return member;
  }

 private:
  // A key holds the cost of a pair in its upper bits and the partner's index in the others. Costs
  // are not negative, so that keys compare as costs do.
  static constexpr std::int32_t index_mask = most_members - 1;
  static constexpr std::int32_t no_key = std::numeric_limits<std::int32_t>::max();
  static constexpr int feature_count = 7;  // place, size, colour
  static constexpr int box_count = 4;      // the first ones: boxes of colours would exclude little
  static constexpr int block_size = 16, most_blocks = most_members / block_size;

  /// A loop that becomes vectors, unlike std::ranges::min.
  template <std::size_t count>
  static std::int32_t least_of(const std::int32_t (&keys)[count]) {
    std::int32_t least = no_key;
    for (const std::int32_t key : keys) least = std::min(least, key);
    return least;
  }

  void widen_box(int i);
  [[nodiscard]] std::int32_t cheapest_in(int block, int i) const;
  void find_bounds(int i);
  void find_partner(int i, int first_block);
  void join(int a, int b);

  int count_, blocks_, groups_;
  double variance_[most_members], weight_[most_members];
  alignas(64) float features_[feature_count][most_members];
  alignas(64) std::int32_t partner_[most_blocks][block_size];  // the key that each group keeps
  int joined_[most_members];
  // By block: a box around its groups, the least key that they keep, and a lower bound of their
  // costs with the group that searches.
  alignas(64) float low_[box_count][most_blocks], high_[box_count][most_blocks];
  alignas(64) std::int32_t least_[most_blocks], bound_[most_blocks];
};

Grouping::Grouping(const Members& members)
    : count_(members.size()), blocks_((count_ + block_size - 1) / block_size), groups_(count_) {
  std::vector<double> values(static_cast<std::size_t>(count_));
  const auto quantile_of = [&](double share, const auto& value) {
    for (std::size_t i = 0; i < values.size(); ++i) values[i] = value(i);
    return quantile(values, share);
  };
  for (int i = 0; i < count_; ++i)
    variance_[i] = members.covariances[static_cast<std::size_t>(i)].trace() / 3.0;
  // Without extremes, so that a few huge or far Gaussians do not decide how others are grouped.
  const double largest = quantile_of(0.98, [&](std::size_t i) { return std::sqrt(variance_[i]); });
  double size = 0.0;
  for (const double value : values) size += std::min(value, largest);
  size = std::max(size / count_, 1e-30);
  glm::dvec3 middle;
  for (int k = 0; k < 3; ++k)
    middle[k] = quantile_of(0.5, [&](std::size_t i) { return double{members.cloud.mean[i][k]}; });
  for (int f = 0; f < feature_count; ++f) {
    std::ranges::fill(features_[f], too_far);
    if (f >= box_count) continue;
    std::ranges::fill(low_[f], too_far);
    std::ranges::fill(high_[f], -too_far);
  }
  // In units of the mean size, so that no square leaves the range of a float.
  constexpr double farthest = 1e15;
  for (int i = 0; i < count_; ++i) {
    const auto at = static_cast<std::size_t>(i);
    const glm::dvec3 position =
        glm::clamp((glm::dvec3(members.cloud.mean[at]) - middle) / size, -farthest, farthest);
    const glm::vec3& base = *members.cloud.sh_of(at);
    for (int k = 0; k < 3; ++k) {
      features_[k][i] = static_cast<float>(position[k]);
      features_[4 + k][i] = colour_reach * sh_c0 * base[k];
    }
    variance_[i] /= size * size;
    features_[3][i] = static_cast<float>(std::sqrt(variance_[i]));
    weight_[i] = members.weights[at];
    joined_[i] = i;
    widen_box(i);
  }
  for (auto& keys : partner_) std::ranges::fill(keys, no_key);
  std::ranges::fill(least_, no_key);
  // A pair needs only one of its groups to know of it.
  for (int i = 0; i < count_; ++i) find_partner(i, i / block_size);
}

void Grouping::widen_box(int i) {
  const int block = i / block_size;
  for (int f = 0; f < box_count; ++f) {
    low_[f][block] = std::min(low_[f][block], features_[f][i]);
    high_[f][block] = std::max(high_[f][block], features_[f][i]);
  }
}

/// The least key of group i with those of a block.
std::int32_t Grouping::cheapest_in(int block, int i) const {
  float at[feature_count];
  for (int f = 0; f < feature_count; ++f) at[f] = features_[f][i];
  std::int32_t keys[block_size];
  const int first = block * block_size;
  for (int j = 0; j < block_size; ++j) {
    float cost = 0.0f;
    for (int f = 0; f < feature_count; ++f) {
      const float d = features_[f][first + j] - at[f];
      cost += d * d;
    }
    keys[j] = (std::bit_cast<std::int32_t>(cost) & ~index_mask) | (first + j);
  }
  if (block == i / block_size) keys[i % block_size] = no_key;
  return least_of(keys);
}

void Grouping::find_bounds(int i) {
  float at[box_count];
  for (int f = 0; f < box_count; ++f) at[f] = features_[f][i];
  for (int block = 0; block < most_blocks; ++block) {
    float cost = 0.0f;
    for (int f = 0; f < box_count; ++f) {
      const float below = low_[f][block] - at[f], above = at[f] - high_[f][block];
      // x + |x| = 2 max(x, 0), which GCC does not turn into vectors.
      const float twice = below + std::abs(below) + (above + std::abs(above));
      cost += twice * twice;
    }
    bound_[block] = std::bit_cast<std::int32_t>(0.25f * cost) & ~index_mask;
  }
}

/// Searches the group's own block, and all from `first_block` on.
void Grouping::find_partner(int i, int first_block) {
  find_bounds(i);
  const int own = i / block_size;
  std::int32_t least = cheapest_in(own, i);
  for (int block = first_block; block < blocks_; ++block)
    if (bound_[block] < least && block != own) least = std::min(least, cheapest_in(block, i));
  partner_[own][i % block_size] = least;
  least_[own] = least_of(partner_[own]);
}

void Grouping::join(int a, int b) {
  const double sum = weight_[a] + weight_[b], share = weight_[b] / sum;
  double moved = 0.0;
  for (int f = 0; f < feature_count; ++f) {
    const double d = static_cast<double>(features_[f][b]) - static_cast<double>(features_[f][a]);
    if (f < 3) moved += d * d;
    features_[f][b] = features_[f][a] + static_cast<float>(share * d);
  }
  variance_[b] =
      variance_[a] + share * (variance_[b] - variance_[a]) + share * (1.0 - share) * moved / 3.0;
  features_[3][b] = static_cast<float>(std::sqrt(variance_[b]));
  weight_[b] = sum;
  widen_box(b);
  joined_[a] = b;
  features_[0][a] = too_far;
  partner_[a / block_size][a % block_size] = no_key;
  least_[a / block_size] = least_of(partner_[a / block_size]);
  --groups_;
}

void Grouping::join_until(int groups) {
  while (groups_ > groups) {
    const std::int32_t least = least_of(least_);
    const auto block = static_cast<int>(std::ranges::find(least_, least) - least_);
    const auto& keys = partner_[block];
    const int a = block * block_size + static_cast<int>(std::ranges::find(keys, least) - keys);
    const int b = least & index_mask;
    if (cheapest_in(b / block_size, a) != least) {
      find_partner(a, 0);
      if (keys[a % block_size] != least) continue;
    }
    join(a, b);
    find_partner(b, 0);
  }
}

/// Moments of a group.
struct Sums {
  int members = 0;
  int last = 0;  // one of them
  double weight = 0.0;
  glm::dvec3 mean{0.0};
  Covariance<double> covariance;
  double squared_displacement = 0.0;
};

struct Merged {
  GaussianCloud cloud;  // without rotations and scales
  std::vector<Factor> factors;
  double displacement = 0.0;  // the 0.9 quantile
};

/// The opacity of a merged Gaussian with the covariance `c`, whose parts have the sum `weight` of
/// opacity x area. Where full opacity would not hide as much, `c` grows, by most_grown at most.
double cover(double weight, Covariance<double>& c) {
  const double opacity = weight / std::max(c.area(), 1e-30);  // a needle has no area
  const double grown = std::clamp(opacity, 1.0, most_grown);
  const Covariance<double> matched = std::exchange(c, {});
  c.add(grown, matched);
  return std::clamp(opacity / grown, alpha_min, double{max_opacity});
}

/// One Gaussian for each group, in the order of the groups' first members.
Merged match_moments(const Members& members, const Grouping& grouping) {
  const auto count = static_cast<std::size_t>(members.size());
  std::vector<int> slot_of_group(count, -1), slots(count);
  std::vector<Sums> sums;
  for (std::size_t i = 0; i < count; ++i) {
    int& slot = slot_of_group[static_cast<std::size_t>(grouping.group_of(static_cast<int>(i)))];
    if (slot < 0) {
      slot = static_cast<int>(sums.size());
      sums.emplace_back();
    }
    slots[i] = slot;
    Sums& s = sums[static_cast<std::size_t>(slot)];
    ++s.members;
    s.last = static_cast<int>(i);
    s.weight += members.weights[i];
    s.mean += members.weights[i] * glm::dvec3(members.cloud.mean[i]);
  }
  for (Sums& s : sums) s.mean /= s.weight;

  const GaussianCloud& from = members.cloud;
  Merged merged;
  merged.cloud.resize(sums.size(), from.sh_degree);
  const auto sh_count = static_cast<std::size_t>(from.sh_count());
  for (std::size_t i = 0; i < count; ++i) {
    const auto slot = static_cast<std::size_t>(slots[i]);
    Sums& s = sums[slot];
    const double share = members.weights[i] / s.weight;
    const glm::dvec3 d = glm::dvec3(from.mean[i]) - s.mean;
    s.covariance.add(share, members.covariances[i]);
    s.covariance.add(share, outer(d));
    s.squared_displacement += share * glm::dot(d, d);
    for (std::size_t k = 0; k < sh_count; ++k)
      merged.cloud.sh[slot * sh_count + k] += static_cast<float>(share) * from.sh[i * sh_count + k];
  }
  std::vector<double> displacements;
  for (std::size_t slot = 0; slot < sums.size(); ++slot) {
    Sums& s = sums[slot];
    const auto last = static_cast<std::size_t>(s.last);
    const bool alone = s.members == 1;
    const auto opacity = static_cast<float>(cover(s.weight, s.covariance));
    merged.cloud.mean[slot] = alone ? from.mean[last] : glm::vec3(s.mean);
    merged.factors.push_back(alone ? members.factors[last] : factor_of(s.covariance));
    merged.cloud.opacity[slot] = alone ? from.opacity[last] : opacity;
    displacements.push_back(alone ? 0.0 : std::sqrt(s.squared_displacement));
  }
  merged.displacement = quantile(displacements, 0.9);
  return merged;
}

/// A box and a reach that hold several, rounded outwards.
Cluster hull(std::span<const Cluster> clusters) {
  glm::dvec3 low(std::numeric_limits<double>::max()), high = -low;
  float reach = 0.0f;
  for (const Cluster& c : clusters) {
    low = glm::min(low, glm::dvec3(c.centre) - glm::dvec3(c.half_extent));
    high = glm::max(high, glm::dvec3(c.centre) + glm::dvec3(c.half_extent));
    reach = std::max(reach, c.reach);
  }
  const glm::vec3 centre(0.5 * (low + high));
  const glm::dvec3 half = glm::max(high - glm::dvec3(centre), glm::dvec3(centre) - low);
  return {centre, glm::vec3(half) * (1.0f + 1e-6f), reach};
}

}  // namespace

NodeFacts merge_nodes(std::span<const NodeView> children, int sh_degree,
                      std::span<std::byte> block) {
  assert(children.size() == 1 || children.size() == 2);
  if (children.size() == 1) {
    std::ranges::copy(children[0].block, block.begin());
    return children[0].facts;
  }
  const Members members(children, sh_degree);
  Grouping grouping(members);
  grouping.join_until(static_cast<int>(cluster_size));
  const Merged merged = match_moments(members, grouping);

  std::array<std::uint32_t, cluster_size> all;
  std::iota(all.begin(), all.end(), 0u);
  const PackedCluster packed =
      pack_cluster(merged.cloud, std::span(all).first(merged.cloud.size()), merged.factors, block);
  const NodeFacts &a = children[0].facts, &b = children[1].facts;
  const std::array bounds = {a.bounds, b.bounds, packed.bounds};
  return {packed.units,
          hull(bounds),
          static_cast<float>(merged.displacement) + std::max(a.error, b.error),
          static_cast<std::uint32_t>(merged.cloud.size()),
          {}};
}

}  // namespace catgs

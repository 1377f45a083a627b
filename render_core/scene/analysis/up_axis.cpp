#include "render_core/scene/analysis/up_axis.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <optional>
#include <vector>

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>
#include <glm/vec2.hpp>
#include <glm/vector_relational.hpp>

#include "render_core/base/even_sample.h"
#include "render_core/math/look_at.h"
#include "render_core/scene/activations.h"
#include "render_core/scene/analysis/robust_bounds.h"

namespace catgs {
namespace {

constexpr glm::vec3 usual_up(0, -1, 0);
constexpr float horizontal = 0.94f,
                vertical = 0.17f;        // normals of floors and walls: 20, 80 degrees
constexpr float smallest_floor = 0.25f;  // of floor_size(); less is the side of a thing

/// A Gaussian as a small piece of some surface.
struct Facet {
  glm::vec3 position, normal;
  float area;       // that it stands for; it counts as no more than a large one of the scene's
  float size;       // its middle standard deviation
  float luminance;  // 0…1
  bool is_flat;     // else its normal says nothing
};

std::vector<Facet> sample_facets(const GaussianCloud& cloud, float stands_for,
                                 const Bounds& bounds) {
  constexpr std::size_t max_facets = std::size_t{1} << 16;
  constexpr float flat = 0.4f;  // smallest to middle standard deviation
  constexpr float two_pi = 6.2831853f;
  // Some Gaussians of a background are as large as the scene and would outvote it.
  const float largest = 0.005f * glm::distance(bounds.min, bounds.max);
  const EvenSample sample(cloud.size(), max_facets);
  std::vector<Facet> facets;
  for (std::size_t k = 0; k < sample.size(); ++k) {
    const std::size_t i = sample[k];
    const glm::vec3& position = cloud.mean[i];
    if (glm::any(glm::lessThan(position, bounds.min)) ||
        glm::any(glm::greaterThan(position, bounds.max)))
      continue;
    const glm::vec3& scale = cloud.scale[i];
    std::array<int, 3> axes = {0, 1, 2};
    std::ranges::sort(axes, {}, [&](int a) { return scale[a]; });
    const float area = std::min(scale[axes[1]], largest) * std::min(scale[axes[2]], largest);
    const glm::vec3 colour = glm::clamp(0.5f + sh_c0 * cloud.sh_of(i)[0], 0.0f, 1.0f);
    facets.push_back(
        {position, glm::mat3_cast(cloud.rotation[i])[axes[0]],
         two_pi * stands_for * static_cast<float>(sample.step()) * cloud.opacity[i] * area,
         std::sqrt(scale[axes[1]] * scale[axes[2]]),
         glm::dot(colour, glm::vec3(0.2126f, 0.7152f, 0.0722f)),  // BT.709
         scale[axes[0]] <= flat * scale[axes[1]]});
  }
  return facets;
}

/// Mean normal of the facets within a cone around `axis`, which narrows.
std::optional<glm::vec3> peak_near(const std::vector<Facet>& facets, glm::vec3 axis) {
  for (const float within : {0.80f, 0.90f, 0.95f, 0.97f}) {  // cosines
    glm::vec3 sum(0.0f);
    for (const Facet& facet : facets) {
      const float along = glm::dot(facet.normal, axis);
      if (facet.is_flat && std::abs(along) > within)
        sum += std::copysign(facet.area, along) * facet.normal;
    }
    if (!(glm::length(sum) > 0.0f)) return std::nullopt;
    axis = glm::normalize(sum);
  }
  return axis;
}

/// The facets in a box around most of their area, with two axes in the plan and one up.
struct UprightBox {
  glm::mat3 axes;
  glm::vec3 low{0.0f}, extent{0.0f};

  UprightBox(const std::vector<Facet>& facets, const glm::vec3& up)
      : axes(perpendicular(up), glm::cross(up, perpendicular(up)), up) {
    for (int k = 0; k < 3; ++k) measure(facets, k);
  }

  /// By area: a coarser level of detail has fewer Gaussians, but covers the same.
  void measure(const std::vector<Facet>& facets, int k) {
    constexpr double tail = 0.02;
    constexpr std::size_t bins = 1024;
    const auto position = [&](const Facet& f) { return glm::dot(f.position, axes[k]); };
    const auto [first, last] = std::ranges::minmax(facets, {}, position);
    const float least = position(first), bin = (position(last) - least) / bins;
    std::array<double, bins + 1> area{};
    for (const Facet& f : facets)
      area[bin > 0.0f ? static_cast<std::size_t>((position(f) - least) / bin) : 0] +=
          static_cast<double>(f.area);
    std::partial_sum(area.begin(), area.end(), area.begin());
    const auto quantile = [&](double share) {
      const auto at = std::ranges::lower_bound(area, share * area.back()) - area.begin();
      return least + bin * (static_cast<float>(at) + 0.5f);
    };
    low[k] = quantile(tail);
    extent[k] = std::max(quantile(1.0 - tail) - low[k], 1e-6f);
  }

  /// 0…1 in the box.
  [[nodiscard]] glm::vec3 position_of(const Facet& facet) const {
    return (facet.position * axes - low) / extent;
  }
};

constexpr int levels = 64;  // of heights
int level_of(float height) {
  return static_cast<int>(std::clamp(height * levels, 0.0f, levels - 1.0f));
}

/// The share of the plan that a floor covers, where that is a level in the lower part; or the same
/// of a ceiling.
float covered(const std::vector<Facet>& facets, const UprightBox& box, bool below) {
  constexpr int plan = 20;
  constexpr float outer_part = 0.4f, occupied = 0.1f;  // optical depth
  const auto is_level = [&](const Facet& f) {
    return f.is_flat && std::abs(glm::dot(f.normal, box.axes[2])) > horizontal;
  };
  const auto height_of = [&](const glm::vec3& position) {  // from the outside
    return level_of(below ? position.z : 1.0f - position.z);
  };
  std::array<float, levels> area{};
  for (const Facet& f : facets)
    if (is_level(f)) area[static_cast<std::size_t>(height_of(box.position_of(f)))] += f.area;
  const auto outer = area.begin() + static_cast<int>(outer_part * levels);
  const int floor = static_cast<int>(std::max_element(area.begin(), outer) - area.begin());
  std::vector<float> cells(plan * plan);
  for (const Facet& f : facets) {
    const glm::vec3 p = box.position_of(f);
    if (!is_level(f) || std::abs(height_of(p) - floor) > 1) continue;
    if (!(p.x >= 0.0f && p.x < 1.0f && p.y >= 0.0f && p.y < 1.0f)) continue;
    const glm::ivec2 cell = glm::min(glm::ivec2(static_cast<float>(plan) * glm::vec2(p)), plan - 1);
    cells[static_cast<std::size_t>(cell.y * plan + cell.x)] += f.area;
  }
  const float full = occupied * box.extent.x * box.extent.y / (plan * plan);
  return static_cast<float>(std::ranges::count_if(cells, [&](float a) { return a > full; })) /
         (plan * plan);
}

/// Correlation of two values over facets.
class Correlation {
 public:
  void add(double x, double y, double weight) {
    w_ += weight;
    x_ += weight * x;
    y_ += weight * y;
    xx_ += weight * x * x;
    yy_ += weight * y * y;
    xy_ += weight * x * y;
  }
  [[nodiscard]] double mean_x() const { return w_ > 0.0 ? x_ / w_ : 0.0; }
  [[nodiscard]] double value() const {
    const double spread = (w_ * xx_ - x_ * x_) * (w_ * yy_ - y_ * y_);
    return spread > 1e-12 * w_ * w_ ? (w_ * xy_ - x_ * y_) / std::sqrt(spread) : 0.0;
  }

 private:
  double w_ = 0.0, x_ = 0.0, y_ = 0.0, xx_ = 0.0, yy_ = 0.0, xy_ = 0.0;
};

/// How far the content says that up is not down, -1…1 about: things stand on a floor, what is low
/// is seen from near and has detail, and light comes from above. It changes its sign with `up`.
float uprightness(const std::vector<Facet>& facets, const UprightBox& box, float floor,
                  float ceiling) {
  constexpr float edge = 0.05f;   // floors and ceilings may bound the box
  constexpr float fine = 0.004f;  // of the height: beyond this, a facet counts as no more
  const float finest_area = fine * fine * box.extent.z * box.extent.z;
  Correlation things, detail, light;
  for (const Facet& f : facets) {
    const glm::vec3 p = box.position_of(f);
    if (glm::any(glm::greaterThan(glm::abs(p - 0.5f), glm::vec3(0.5f + edge)))) continue;
    const double height = static_cast<double>(2.0f * p.z - 1.0f),
                 area = static_cast<double>(f.area);
    const float own = f.size * f.size;
    things.add(height, 0.0,
               area * static_cast<double>(std::min(1.0f, finest_area / std::max(own, 1e-30f))));
    detail.add(height, std::log(static_cast<double>(f.size) + 1e-30), 1.0);
    light.add(height, static_cast<double>(f.luminance), area);
  }
  // Rooms have both. What a floor and a ceiling of one room lack in size means little.
  const float open = (floor - ceiling) / std::max(floor + ceiling, 0.02f);
  return 0.5f * open * std::abs(open) +
         static_cast<float>(detail.value() + light.value() - things.mean_x());
}

/// How well the content stands upright on an axis.
struct Upright {
  float floor = 0.0f;  // or ceiling; a facade or the side of a thing is smaller
  float sense = 0.0f;  // > 0: it is up rather than down
};

Upright judge(const std::vector<Facet>& facets, const glm::vec3& up) {
  const UprightBox box(facets, up);
  const float floor = covered(facets, box, true), ceiling = covered(facets, box, false);
  const float smallest = std::min({box.extent.x, box.extent.y, box.extent.z});
  return {std::max(floor, ceiling) * smallest / box.extent.z,
          uprightness(facets, box, floor, ceiling)};
}

/// How usual it is that a scene has this up: captures of COLMAP have y down, surveys have z up,
/// some tools turn y up.
float habit(const glm::vec3& up, UsualUp usual) {
  const float y_down = usual == UsualUp::plus_z ? 0.6f : 1.0f;
  const float y_up = usual == UsualUp::either_y ? 1.0f : 0.4f;
  const float z_up = usual == UsualUp::plus_z ? 1.0f : 0.6f;
  return std::max({0.3f, -y_down * up.y * std::abs(up.y), z_up * up.z * std::abs(up.z),
                   y_up * up.y * std::abs(up.y)});
}

/// The axis on which the largest floor lies, in the sense that the content tells. Without a floor
/// the usual axis.
glm::vec3 upright_axis(const std::vector<Facet>& facets, UsualUp usual) {
  const glm::vec3 first = usual == UsualUp::plus_z ? glm::vec3(0, 0, 1) : usual_up;
  if (facets.empty()) return first;
  constexpr float trust = 2.5f, most = 0.6f;
  const auto factor = [&](float sense) { return std::exp(trust * std::clamp(sense, -most, most)); };
  glm::vec3 best = first;
  float best_score = 0.0f;
  const auto consider = [&](const glm::vec3& axis, float floor, float sense) {
    const float score = habit(axis, usual) * floor * factor(sense);
    if (score <= best_score) return;
    best_score = score;
    best = axis;
  };
  std::vector<glm::vec3> axes;
  const auto add = [&](const std::optional<glm::vec3>& axis) {
    const auto same = [&](const glm::vec3& other) {
      return std::abs(glm::dot(*axis, other)) > 0.999f;
    };
    if (axis && std::ranges::none_of(axes, same)) axes.push_back(*axis);
  };
  // Most scenes stand on an axis of their file.
  for (int k = 0; k < 3; ++k) add(glm::mat3(1.0f)[k]);
  for (int k = 0; k < 13; ++k)  // the half of 26 directions that is not opposite to the others
    add(peak_near(facets, glm::normalize(glm::vec3(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1))));
  for (const glm::vec3& axis : axes) {
    const auto [floor, sense] = judge(facets, axis);
    if (floor < smallest_floor) continue;
    for (const float sign : {1.0f, -1.0f})
      if (habit(sign * axis, usual) * floor * std::max(1.0f, factor(sign * sense)) > smallest_floor)
        consider(sign * axis, floor, sign * sense);
  }
  if (best_score > 0.0f) return best;
  const float sense = judge(facets, first).sense;
  consider(first, 1.0f, sense);
  consider(-first, 1.0f, -sense);
  return best;
}

/// Sum of the cameras' up vectors over their number; short where they cancel out.
glm::vec3 mean_up(std::span<const Pose> cameras) {
  glm::vec3 sum(0.0f);
  for (const Pose& pose : cameras) sum += pose.orientation * usual_up;
  return sum / static_cast<float>(std::max<std::size_t>(1, cameras.size()));
}

/// The unit vector u that minimises the mean of (u · r)² over the cameras' right vectors r and the
/// walls' normals, and of |u - (u · n) n|² over the floors' normals n, with a weak pull towards
/// `guess` for the directions that none of them determines: (A + e I) u ~ e guess, the stationary
/// point of a quadratic form.
glm::vec3 level(const glm::vec3& guess, const std::vector<Facet>& facets,
                std::span<const Pose> cameras) {
  constexpr float pull = 1e-3f;
  constexpr float trust = 0.5f;  // in surfaces, relative to cameras
  glm::mat3 from_cameras(0.0f);
  for (const Pose& pose : cameras) {
    const glm::vec3 right = pose.orientation * glm::vec3(1, 0, 0);
    from_cameras += glm::outerProduct(right, right) / static_cast<float>(cameras.size());
  }
  float area = 1e-30f;
  for (const Facet& facet : facets)
    if (facet.is_flat) area += facet.area;
  glm::vec3 up = guess;
  for (int round = 0; round < 4; ++round) {
    glm::mat3 form = from_cameras + glm::mat3(pull);
    for (const Facet& facet : facets) {
      if (!facet.is_flat) continue;
      const float along = std::abs(glm::dot(facet.normal, up));
      const glm::mat3 square = glm::outerProduct(facet.normal, facet.normal);
      const float weight = trust * facet.area / area;
      if (along > horizontal) form += weight * (glm::mat3(1.0f) - square);
      if (along < vertical) form += weight * square;
    }
    up = glm::normalize(glm::inverse(form) * guess);
  }
  return up;
}

}  // namespace

glm::vec3 find_up(const GaussianCloud& cloud, std::span<const Pose> cameras, float stands_for,
                  UsualUp usual) {
  std::vector<Facet> facets;
  if (const auto bounds = robust_bounds(cloud, 0.01f))
    facets = sample_facets(cloud, stands_for, *bounds);
  const glm::vec3 held = mean_up(cameras);
  if (glm::length(held) < 0.2f) cameras = {};  // none, or those of a drone that looks straight down
  const glm::vec3 guess =
      cameras.empty() ? upright_axis(facets, usual) : level(glm::normalize(held), {}, cameras);
  // The surfaces of a thing without a floor are level by chance only.
  const auto axis = peak_near(facets, guess);
  const bool has_floor =
      axis && glm::dot(*axis, guess) > horizontal && judge(facets, guess).floor > smallest_floor;
  return has_floor ? level(guess, facets, cameras) : guess;
}

}  // namespace catgs

#include "render_core/scene/files/sanitize.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstdint>
#include <vector>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "render_core/math/camera.h"
#include "render_core/math/constants.h"
#include "render_core/scene/activations.h"
#include "render_core/scene/analysis/robust_bounds.h"
#include "render_core/scene/keep_if.h"

namespace catgs {

namespace {

constexpr float least_opacity = static_cast<float>(alpha_min);
// A file that stores the logit returns slightly less than was written.
constexpr float invisible_opacity = least_opacity * (1.0f - 1e-5f);
constexpr float absurd_diagonals = 1e4f;
constexpr float min_scale = 1e-10f;

enum class Verdict : std::uint8_t { keep, repaired, not_finite, invisible, absurd };

bool finite(const glm::vec3& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

bool contains(const SaneReach& reach, const glm::vec3& mean, float largest_scale) {
  const glm::vec3 m = glm::abs(mean);
  if (std::max({m.x, m.y, m.z, largest_scale}) > max_coordinate) return false;
  return reach.radius == 0.0f ||
         (glm::distance(mean, reach.centre) <= reach.radius && largest_scale <= reach.radius);
}

struct Repairs {
  std::size_t zero_rotations = 0, clamped = 0, zeroed_sh = 0;
};

bool repair_rotation(glm::quat& q, Repairs& repairs) {
  const float squared = glm::dot(q, q);
  if (squared > 1e-24f && std::isfinite(squared)) {
    q = unit(q);
    return false;
  }
  const float largest = std::max({std::abs(q.x), std::abs(q.y), std::abs(q.z), std::abs(q.w)});
  if (largest > 0.0f) {  // finite, but its square under- or overflowed
    q = glm::normalize(q / largest);
    return false;
  }
  q = glm::quat(1.0f, 0.0f, 0.0f, 0.0f);
  ++repairs.zero_rotations;
  return true;
}

// A colour is 0…1. Sums of such coefficients stay within half precision, which cores blend with.
constexpr float absurd_sh = 1e3f;

bool repair_sh(GaussianCloud& cloud, std::size_t i, Repairs& repairs) {
  glm::vec3* sh = cloud.sh.data() + i * cloud.sh_count();
  bool bad = false;
  for (int k = 0; k < cloud.sh_count(); ++k)
    for (int channel = 0; channel < 3; ++channel)
      if (!(std::abs(sh[k][channel]) <= absurd_sh)) {
        sh[k][channel] = 0.0f;
        bad = true;
      }
  repairs.zeroed_sh += bad;
  return bad;
}

Verdict judge(GaussianCloud& cloud, std::size_t i, const SaneReach& reach, Repairs& repairs) {
  glm::quat& q = cloud.rotation[i];
  glm::vec3& scale = cloud.scale[i];
  float& opacity = cloud.opacity[i];
  if (!finite(cloud.mean[i]) || !finite(scale) || !std::isfinite(opacity) ||
      !finite({q.x, q.y, q.z}) || !std::isfinite(q.w))
    return Verdict::not_finite;
  if (opacity < invisible_opacity) return Verdict::invisible;
  opacity = std::max(opacity, least_opacity);
  if (!contains(reach, cloud.mean[i], std::max({scale.x, scale.y, scale.z})))
    return Verdict::absurd;

  bool repaired = repair_rotation(q, repairs);
  const glm::vec3 old_scale = scale;
  const float old_opacity = opacity;
  scale = glm::max(scale, min_scale);
  opacity = std::min(opacity, max_opacity);
  if (scale != old_scale || opacity != old_opacity) {
    ++repairs.clamped;
    repaired = true;
  }
  repaired |= repair_sh(cloud, i, repairs);
  return repaired ? Verdict::repaired : Verdict::keep;
}

}  // namespace

SaneReach sane_reach(const GaussianCloud& cloud) {
  SaneReach reach;
  if (const auto bounds = robust_bounds(cloud, 0.01f)) {
    reach.centre = 0.5f * (bounds->min + bounds->max);
    reach.radius = absurd_diagonals * glm::distance(bounds->min, bounds->max);
    if (!std::isfinite(reach.radius)) reach.radius = 0.0f;
  }
  return reach;
}

SanitizeReport sanitize(GaussianCloud& cloud, const LoadContext& context) {
  return sanitize(cloud, sane_reach(cloud), context);
}

SanitizeReport sanitize(GaussianCloud& cloud, const SaneReach& reach, const LoadContext& context) {
  std::vector<Verdict> verdicts(cloud.size());
  std::array<std::atomic<std::size_t>, 5> counts{};
  std::atomic<std::size_t> zero_rotations{0}, clamped{0}, zeroed_sh{0};
  context.for_blocks(cloud.size(), 4096, [&](std::size_t begin, std::size_t end) {
    Repairs repairs;
    std::array<std::size_t, 5> block_counts{};
    for (std::size_t i = begin; i < end; ++i) {
      verdicts[i] = judge(cloud, i, reach, repairs);
      ++block_counts[static_cast<std::size_t>(verdicts[i])];
    }
    for (std::size_t v = 0; v < counts.size(); ++v) counts[v] += block_counts[v];
    zero_rotations += repairs.zero_rotations;
    clamped += repairs.clamped;
    zeroed_sh += repairs.zeroed_sh;
  });

  const auto count = [&](Verdict v) { return counts[static_cast<std::size_t>(v)].load(); };
  SanitizeReport report;
  report.read = cloud.size();
  report.not_finite = count(Verdict::not_finite);
  report.invisible = count(Verdict::invisible);
  report.absurd = count(Verdict::absurd);
  report.dropped = report.not_finite + report.invisible + report.absurd;
  report.repaired = count(Verdict::repaired);
  report.zero_rotations = zero_rotations;
  report.clamped = clamped;
  report.zeroed_sh = zeroed_sh;
  if (report.dropped > 0)
    keep_if(cloud, [&](std::size_t i) { return verdicts[i] <= Verdict::repaired; });
  return report;
}

}  // namespace catgs

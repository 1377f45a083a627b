#include "render_core/scene/formats/losses.h"

#include <algorithm>
#include <utility>

#include <fmt/format.h>

namespace catgs {

float middle_scale(const glm::vec3& scale) {
  return std::max(std::min(scale.x, scale.y), std::min(std::max(scale.x, scale.y), scale.z));
}

std::string Losses::share(std::size_t count) const {
  return fmt::format("{} of {} Gaussians", count, cloud_.size());
}

void Losses::positions(const std::function<float(const glm::vec3& mean)>& step_at) {
  std::size_t smaller = 0;
  float largest = 0.0f;
  for (std::size_t i = 0; i < cloud_.size(); ++i) {
    const float step = step_at(cloud_.mean[i]);
    if (middle_scale(cloud_.scale[i]) >= step) continue;
    ++smaller;
    largest = std::max(largest, step);
  }
  if (smaller > 0)
    add(fmt::format(
        "positions are stored in steps of up to {:.3g}, and {} are smaller than the step "
        "where they are; .ply and .glb keep them",
        largest, share(smaller)));
}

void Losses::moved(std::span<const glm::vec3> stored) {
  std::size_t moved = 0;
  for (std::size_t i = 0; i < stored.size(); ++i) moved += stored[i] != cloud_.mean[i] ? 1 : 0;
  if (moved > 0)
    add(
        fmt::format("{} are far from all others, and are moved nearer and made as much smaller; "
                    ".ply and .glb keep them",
                    share(moved)));
}

void Losses::scales(float least, float most) {
  std::size_t enlarged = 0, shrunk = 0;
  float times_larger = 1.0f, times_smaller = 1.0f;
  for (const glm::vec3& scale : cloud_.scale) {
    const float middle = middle_scale(scale), largest = std::max({scale.x, scale.y, scale.z});
    if (middle < least) {
      ++enlarged;
      times_larger = std::max(times_larger, least / middle);
    }
    if (largest > most) {
      ++shrunk;
      times_smaller = std::max(times_smaller, largest / most);
    }
  }
  if (enlarged > 0)
    add(
        fmt::format("{} are smaller than {:.3g}, the least scale, and become up to {:.3g} times as "
                    "large; enlarge the scene with --scale",
                    share(enlarged), least, times_larger));
  if (shrunk > 0)
    add(fmt::format(
        "{} are larger than {:.3g}, the largest scale, and become up to {:.3g} times as "
        "small; make the scene smaller with --scale",
        share(shrunk), most, times_smaller));
}

void Losses::harmonics(int first, int last, float least, float most, std::string_view what) {
  const int begin = sh_coefficient_count(first - 1), end = sh_coefficient_count(last);
  std::size_t clamped = 0;
  for (std::size_t i = 0; i < cloud_.size(); ++i) {
    const glm::vec3* sh = cloud_.sh_of(i);
    clamped +=
        std::any_of(sh + begin, sh + std::min(end, cloud_.sh_count()), [&](const glm::vec3& v) {
          return std::min({v.x, v.y, v.z}) < least || std::max({v.x, v.y, v.z}) > most;
        });
  }
  if (clamped > 0)
    add(fmt::format("{} have {}, which are clamped; .ply and .glb keep them", share(clamped),
                    what));
}

}  // namespace catgs

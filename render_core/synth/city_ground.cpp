#include "render_core/synth/city_ground.h"

#include <algorithm>

#include <glm/common.hpp>

namespace catgs::synth {
namespace {

constexpr float longest_piece_m = 13.0f;

}  // namespace

glm::vec3 Ground::point(float a, float c, float height) const {
  return along_x ? at(origin.x + a, height, origin.y + c) : at(origin.x + c, height, origin.y + a);
}

float Ground::detail(float a, float c) const {
  const glm::vec3 p = point(a, c, 0.0f);
  return detail_at({p.x, p.z});
}

Patch Ground::patch(float a0, float a1, float c0, float c1, float height) const {
  const glm::vec3 corner = point(a0, c0, height);
  const glm::vec3 u = point(a1, c0, height) - corner;
  const glm::vec3 v = point(a0, c1, height) - corner;
  return along_x ? Patch{corner, u, v} : Patch{corner, v, u};  // cross(x, z) points up
}

Finish Ground::asphalt() const {
  return {.albedo = glm::vec3(0.155f, 0.15f, 0.148f),
          .gloss = Gloss::asphalt,
          .sky_visibility = 0.78f,
          .mottle = 0.09f,
          .haze = haze};
}

Finish Ground::line() const {
  return {.albedo = glm::vec3(0.70f, 0.68f, 0.62f),
          .gloss = Gloss::asphalt,
          .gloss_gain = 0.5f,
          .sky_visibility = 0.78f,
          .mottle = 0.10f,
          .haze = haze};
}

Finish Ground::paving(float sky_visibility) const {
  return {.albedo = glm::vec3(0.37f, 0.335f, 0.29f),
          .sky_visibility = sky_visibility,
          .mottle = 0.13f,
          .haze = haze};
}

void focus_on(Painter& painter, const Patch& patch) {
  if (painter.measuring()) return;
  const glm::vec3 far = patch.corner + patch.u + patch.v;
  const glm::vec3 margin(0.25f);
  painter.shadows().focus(
      {glm::min(patch.corner, far) - margin, glm::max(patch.corner, far) + margin});
}

void paint_rectangle(Painter& painter, const Ground& ground, float a0, float a1, float c0, float c1,
                     const Finish& finish, double density, std::uint64_t index, float height,
                     float overlap) {
  const int along = std::max(1, static_cast<int>(std::floor((a1 - a0) / longest_piece_m + 0.6f)));
  const int across = std::max(1, static_cast<int>(std::floor((c1 - c0) / longest_piece_m + 0.6f)));
  const float da = (a1 - a0) / static_cast<float>(along);
  const float dc = (c1 - c0) / static_cast<float>(across);
  const std::uint64_t key = child(ground.key, index);
  for (int i = 0; i < along; ++i) {
    for (int j = 0; j < across; ++j) {
      const float a = a0 + da * static_cast<float>(i), c = c0 + dc * static_cast<float>(j);
      const Patch patch = ground.patch(a, a + da, c, c + dc, height);
      focus_on(painter, patch);
      const double weight =
          density * ground.detail(a + 0.5f * da, c + 0.5f * dc) * static_cast<double>(da) * dc;
      paint_patch(painter, patch, finish, weight,
                  child(key, static_cast<std::uint64_t>(i * across + j)), overlap);
    }
  }
}

}  // namespace catgs::synth

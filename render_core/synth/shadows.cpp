#include "render_core/synth/shadows.h"

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "render_core/synth/exact_math.h"

namespace catgs::synth {

void Shadows::add_box(const glm::vec3& min, const glm::vec3& max) { boxes_.push_back({min, max}); }

void Shadows::add_ball(const glm::vec3& centre, float radius, float density) {
  balls_.push_back({centre, radius, density});
}

bool Shadows::may_shade(const glm::vec3& min, const glm::vec3& max, const Bounds& region) const {
  // An occluder shades no farther than the point where the ray from its top reaches the region's
  // bottom (y points down: the top is min.y).
  const float drop = region.max.y - min.y;
  if (drop <= 0.0f) return false;
  const float reach = drop / -to_sun_.y;
  const float dx = -to_sun_.x * reach;
  const float dz = -to_sun_.z * reach;
  return glm::min(min.x, min.x + dx) <= region.max.x &&
         glm::max(max.x, max.x + dx) >= region.min.x &&
         glm::min(min.z, min.z + dz) <= region.max.z && glm::max(max.z, max.z + dz) >= region.min.z;
}

void Shadows::keep(const Bounds& region) {
  focus(region);
  boxes_ = near_boxes_;
  balls_ = near_balls_;
}

void Shadows::focus(const Bounds& region) {
  near_boxes_.clear();
  near_balls_.clear();
  for (const Box& box : boxes_) {
    if (may_shade(box.min, box.max, region)) near_boxes_.push_back(box);
  }
  for (const Ball& ball : balls_) {
    const glm::vec3 r(ball.radius);
    if (may_shade(ball.centre - r, ball.centre + r, region)) near_balls_.push_back(ball);
  }
}

float Shadows::sun_visibility(const glm::vec3& point) const {
  const glm::vec3 inverse = 1.0f / to_sun_;
  for (const Box& box : near_boxes_) {
    const glm::vec3 a = (box.min - point) * inverse;
    const glm::vec3 b = (box.max - point) * inverse;
    const glm::vec3 enter = glm::min(a, b);
    const glm::vec3 leave = glm::max(a, b);
    const float first = glm::max(glm::max(enter.x, enter.y), glm::max(enter.z, 0.0f));
    const float last = glm::min(leave.x, glm::min(leave.y, leave.z));
    if (first < last) return 0.0f;
  }
  float visibility = 1.0f;
  for (const Ball& ball : near_balls_) {
    const glm::vec3 offset = ball.centre - point;
    const float along = glm::dot(offset, to_sun_);
    if (along <= 0.0f) continue;
    const float r2 = ball.radius * ball.radius;
    const float miss2 = glm::dot(offset, offset) - along * along;
    if (miss2 < r2) visibility *= 1.0f - ball.density * smooth_step(1.0f, 0.45f, miss2 / r2);
  }
  return visibility;
}

}  // namespace catgs::synth

#include "tests/load/warp.h"

#include <algorithm>
#include <cmath>

#include <glm/gtc/quaternion.hpp>
#include <glm/vec3.hpp>

namespace catgs::load {
namespace {

constexpr double farthest = 4.0;

}  // namespace

glm::dmat3 warp_matrix(const Eye& picture, const Eye& view, double picture_aspect,
                       double view_aspect, double distance) {
  const glm::dquat from_view(view.world_from_camera.orientation);
  const glm::dquat to_picture = glm::conjugate(glm::dquat(picture.world_from_camera.orientation));
  const glm::dvec3 moved =
      glm::dvec3(view.world_from_camera.position) - glm::dvec3(picture.world_from_camera.position);
  const double from_tan = std::tan(0.5 * view.fov_y_rad);
  const double to_tan = std::tan(0.5 * picture.fov_y_rad);
  const glm::dmat3 turn = glm::mat3_cast(glm::normalize(to_picture * from_view));
  const glm::dvec3 to_unit(1.0 / (to_tan * picture_aspect), 1.0 / to_tan, 1.0);
  return {turn[0] * from_tan * view_aspect * to_unit, turn[1] * from_tan * to_unit,
          (turn[2] + (to_picture * moved) / distance) * to_unit};
}

std::optional<glm::dvec2> warped(const glm::dmat3& picture_from_view, const glm::dvec2& at) {
  const glm::dvec3 p = picture_from_view * glm::dvec3(at, 1.0);
  if (p.z <= 1e-6) return {};
  return glm::dvec2(p) / p.z;
}

glm::dvec2 reach(const glm::dmat3& picture_from_view) {
  glm::dvec2 most(0.0);
  for (const double v : {-1.0, -0.5, 0.0, 0.5, 1.0}) {
    for (const glm::dvec2& probe :
         {glm::dvec2(v, -1), glm::dvec2(v, 1), glm::dvec2(-1, v), glm::dvec2(1, v)}) {
      const auto at = warped(picture_from_view, probe);
      most = glm::max(most, at ? glm::abs(*at) : glm::dvec2(farthest));
    }
  }
  return glm::min(most, farthest);
}

double uncovered_share(const glm::dmat3& picture_from_view) {
  constexpr int columns = 64, rows = 36;
  int uncovered = 0;
  for (int i = 0; i < columns * rows; ++i) {
    const glm::dvec2 middle(2 * (i % columns) + 1, 2 * (i / columns) + 1);
    const auto at = warped(picture_from_view, middle / glm::dvec2(columns, rows) - 1.0);
    if (!at || std::abs(at->x) > 1.0 || std::abs(at->y) > 1.0) ++uncovered;
  }
  return static_cast<double>(uncovered) / (columns * rows);
}

float widened_fov(float fov_y_rad, double factor) {
  const double wide = 2.0 * std::atan(std::tan(0.5 * fov_y_rad) * factor);
  return std::clamp(static_cast<float>(wide), 0.1f, 2.8f);
}

void append_sample(const Image& picture, const glm::dvec2& at, Image& out) {
  const glm::dvec2 most(picture.size_px - 1);
  const glm::dvec2 px =
      glm::clamp((0.5 + 0.5 * at) * glm::dvec2(picture.size_px) - 0.5, glm::dvec2(0.0), most);
  const glm::ivec2 low(px), high = glm::min(low + 1, picture.size_px - 1);
  const glm::vec2 part(px - glm::dvec2(low));
  const float *above = picture.row(low.y), *below = picture.row(high.y);
  for (int c = 0; c < 3; ++c) {
    const int left = 3 * low.x + c, right = 3 * high.x + c;
    const float top = std::lerp(above[left], above[right], part.x);
    out.rgb.push_back(std::lerp(top, std::lerp(below[left], below[right], part.x), part.y));
  }
}

Image warp_image(const Image& picture, const glm::dmat3& picture_from_view, glm::ivec2 size_px) {
  Image view{size_px, {}};
  view.rgb.reserve(3 * static_cast<std::size_t>(size_px.x) * static_cast<std::size_t>(size_px.y));
  for (int y = 0; y < size_px.y; ++y) {
    for (int x = 0; x < size_px.x; ++x) {
      const glm::dvec2 at = (2.0 * glm::dvec2(x, y) + 1.0) / glm::dvec2(size_px) - 1.0;
      const glm::dvec3 p = picture_from_view * glm::dvec3(at, 1.0);
      append_sample(picture, glm::dvec2(p) / std::max(p.z, 1e-6), view);
    }
  }
  return view;
}

}  // namespace catgs::load

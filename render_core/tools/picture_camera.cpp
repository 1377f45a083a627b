#include "render_core/tools/picture_camera.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <sstream>

#include <fmt/format.h>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "render_core/image/png.h"

namespace catgs {
namespace {

double largest(const glm::vec2& v) { return std::max(std::abs(v.x), std::abs(v.y)); }

}  // namespace

std::string camera_text(const Camera& camera) {
  const auto& [p, q] = camera.world_from_camera;
  const glm::vec2 &f = camera.focal_px, &c = camera.principal_point_px;
  return fmt::format("{} {} {} {} {} {} {} {} {} {} {}", p.x, p.y, p.z, q.x, q.y, q.z, q.w, f.x,
                     f.y, c.x, c.y);
}

std::optional<Camera> camera_of_picture(const std::filesystem::path& path) {
  std::istringstream text(text_in_png(path, camera_key));
  Camera camera;
  auto& [p, q] = camera.world_from_camera;
  for (float* number :
       {&p.x, &p.y, &p.z, &q.x, &q.y, &q.z, &q.w, &camera.focal_px.x, &camera.focal_px.y,
        &camera.principal_point_px.x, &camera.principal_point_px.y})
    text >> *number;
  if (!text) return std::nullopt;
  return camera;
}

CameraDifference::CameraDifference(const Camera& a, const Camera& b) {
  const auto& [pa, qa] = a.world_from_camera;
  const auto& [pb, qb] = b.world_from_camera;
  units = glm::distance(glm::dvec3(pa), glm::dvec3(pb));
  const glm::dquat turn = glm::conjugate(glm::dquat(qa)) * glm::dquat(qb);
  degrees = 360.0 / std::numbers::pi *
            std::atan2(glm::length(glm::dvec3(turn.x, turn.y, turn.z)), std::abs(turn.w));
  pixels = std::max(largest(a.focal_px - b.focal_px),
                    largest(a.principal_point_px - b.principal_point_px));
  const double reach = 1.0 + std::max(glm::length(glm::dvec3(pa)), glm::length(glm::dvec3(pb)));
  matters_ = !(units <= 1e-5 * reach && degrees <= 2e-3 && pixels <= 0.02);
}

}  // namespace catgs

#include "render_core/tools/picture_camera.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <sstream>

#include <fmt/format.h>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "render_core/image/png.h"

namespace catgs {
namespace {

constexpr const char* orthographic_word = " orthographic";

double largest(const glm::vec2& v) { return std::max(std::abs(v.x), std::abs(v.y)); }

}  // namespace

std::string camera_text(const PictureCamera& of) {
  const glm::quat& q = of.camera.world_from_camera.orientation;
  const glm::vec2 &f = of.camera.focal_px, &c = of.camera.principal_point_px;
  const glm::dvec3 p = of.position(), &o = of.origin;
  return fmt::format("{} {} {} {} {} {} {} {} {} {} {} {} {} {}", p.x, p.y, p.z, q.x, q.y, q.z, q.w,
                     f.x, f.y, c.x, c.y, o.x, o.y, o.z) +
         (of.camera.orthographic ? orthographic_word : "");
}

std::optional<PictureCamera> camera_of_picture(const std::filesystem::path& path) {
  std::istringstream text(text_in_png(path, camera_key));
  PictureCamera of;
  Camera& camera = of.camera;
  auto& [position, q] = camera.world_from_camera;
  glm::dvec3 p, origin;
  text >> p.x >> p.y >> p.z;
  for (float* number : {&q.x, &q.y, &q.z, &q.w, &camera.focal_px.x, &camera.focal_px.y,
                        &camera.principal_point_px.x, &camera.principal_point_px.y})
    text >> *number;
  if (!text) return std::nullopt;
  if (text >> origin.x >> origin.y >> origin.z) of.origin = origin;
  std::string word;
  camera.orthographic = text >> word && " " + word == orthographic_word;
  position = glm::vec3(p - of.origin);
  return of;
}

CameraDifference::CameraDifference(const PictureCamera& of_a, const PictureCamera& of_b) {
  const Camera &a = of_a.camera, &b = of_b.camera;
  const auto& [pa, qa] = a.world_from_camera;
  const auto& [pb, qb] = b.world_from_camera;
  units = glm::distance(of_a.position(), of_b.position());
  const glm::dquat turn = glm::conjugate(glm::dquat(qa)) * glm::dquat(qb);
  degrees = 360.0 / std::numbers::pi *
            std::atan2(glm::length(glm::dvec3(turn.x, turn.y, turn.z)), std::abs(turn.w));
  pixels = std::max(largest(a.focal_px - b.focal_px),
                    largest(a.principal_point_px - b.principal_point_px));
  if (a.orthographic != b.orthographic) pixels = std::numeric_limits<double>::infinity();
  const double reach = 1.0 + std::max(glm::length(glm::dvec3(pa)), glm::length(glm::dvec3(pb)));
  matters_ = !(units <= 1e-5 * reach && degrees <= 2e-3 && pixels <= 0.02);
}

}  // namespace catgs

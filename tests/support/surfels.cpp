#include "tests/support/surfels.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numeric>
#include <random>

#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/mat3x3.hpp>
#include <glm/vec2.hpp>

#include "render_core/math/constants.h"

namespace catgs::test {

namespace {

/// A disc in camera space.
struct Disc {
  glm::dvec3 centre, axis_u, axis_v, normal;  // axes of the length 1 / standard deviation
  glm::dvec2 centre_px;
  glm::dvec3 colour;
  double opacity;
};

double weight(const Disc& disc, const glm::dvec3& ray, const glm::dvec2& pixel) {
  const glm::dvec2 off = pixel - disc.centre_px;
  double squared = 2.0 * glm::dot(off, off);  // the low-pass
  const double across = glm::dot(disc.normal, ray);
  if (across != 0.0) {
    const double along = glm::dot(disc.normal, disc.centre) / across;
    const glm::dvec3 point = along * ray - disc.centre;
    const double u = glm::dot(point, disc.axis_u), v = glm::dot(point, disc.axis_v);
    if (along > 0.0) squared = std::min(squared, u * u + v * v);
  }
  return std::exp(-0.5 * squared);
}

std::vector<Disc> discs_of(const GaussianCloud& cloud, const Camera& camera) {
  const glm::dmat3 turn =
      glm::mat3_cast(glm::conjugate(glm::dquat(camera.world_from_camera.orientation)));
  std::vector<Disc> discs;
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    Disc disc;
    disc.centre =
        turn * (glm::dvec3(cloud.mean[i]) - glm::dvec3(camera.world_from_camera.position));
    if (disc.centre.z < camera.near_z) continue;
    const glm::dmat3 axes = turn * glm::mat3_cast(glm::dquat(cloud.rotation[i]));
    disc.axis_u = axes[0] / double{cloud.scale[i].x};
    disc.axis_v = axes[1] / double{cloud.scale[i].y};
    disc.normal = axes[2];
    disc.centre_px = glm::dvec2(disc.centre) / disc.centre.z * glm::dvec2(camera.focal_px) +
                     glm::dvec2(camera.principal_point_px);
    disc.colour = glm::max(0.5 + sh_basis_0 * glm::dvec3(cloud.sh[i]), 0.0);
    disc.opacity = cloud.opacity[i];
    discs.push_back(disc);
  }
  std::ranges::stable_sort(discs, {}, [](const Disc& disc) { return disc.centre.z; });
  return discs;
}

}  // namespace

std::vector<float> render_surfels(const GaussianCloud& cloud, const FrameRequest& request) {
  const Camera& camera = request.camera;
  const std::vector<Disc> discs = discs_of(cloud, camera);
  std::vector<float> rgb;
  for (int y = 0; y < camera.size_px.y; ++y)
    for (int x = 0; x < camera.size_px.x; ++x) {
      const glm::dvec2 pixel(x + 0.5, y + 0.5);
      const glm::dvec3 ray(
          (pixel - glm::dvec2(camera.principal_point_px)) / glm::dvec2(camera.focal_px), 1.0);
      glm::dvec3 colour(0.0);
      double left = 1.0;
      for (const Disc& disc : discs) {
        const double alpha = std::min(0.99, disc.opacity * weight(disc, ray, pixel));
        if (alpha < 1.0 / 255) continue;
        if (left * (1.0 - alpha) < 1e-4) break;
        colour += left * alpha * disc.colour;
        left *= 1.0 - alpha;
      }
      colour = glm::clamp(colour + left * glm::dvec3(request.background), 0.0, 1.0);
      for (int c = 0; c < 3; ++c) rgb.push_back(static_cast<float>(colour[c]));
    }
  return rgb;
}

GaussianCloud surfel_room() {
  std::mt19937 random(5);
  const auto uniform = [&](float low, float high) {
    return low + (high - low) * static_cast<float>(random()) * 0x1p-32f;
  };
  constexpr std::size_t floor_discs = 1600, wall_discs = 400;
  GaussianCloud cloud;
  cloud.model = SplatModel::surfels;
  cloud.resize(floor_discs + wall_discs, 0);
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    const bool floor = i < floor_discs;
    const glm::vec2 point(uniform(-4.0f, 4.0f),
                          floor ? uniform(-4.0f, 4.0f) : uniform(-2.0f, 0.0f));
    cloud.mean[i] = floor ? glm::vec3(point.x, 0.0f, point.y) : glm::vec3(point, 4.0f);
    const glm::quat upright = glm::angleAxis(1.5707963f, glm::vec3(1, 0, 0));  // z becomes -y
    cloud.rotation[i] = (floor ? upright : glm::quat(1, 0, 0, 0)) *
                        glm::angleAxis(uniform(0.0f, 3.1f), glm::vec3(0, 0, 1));
    cloud.scale[i].x = uniform(0.08f, 0.2f);
    cloud.scale[i].y = uniform(0.08f, 0.2f);
    cloud.scale[i].z = 1e-3f * std::min(cloud.scale[i].x, cloud.scale[i].y);  // as when loaded
    cloud.opacity[i] = uniform(0.5f, 0.95f);
    const bool dark =
        (static_cast<int>(std::floor(point.x)) + static_cast<int>(std::floor(point.y))) % 2;
    cloud.sh[i] = glm::vec3(dark ? -1.2f : 1.0f, uniform(-1.0f, 1.0f), dark ? 0.8f : -0.6f);
  }
  return cloud;
}

}  // namespace catgs::test

#include "tests/support/test_scenes.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <stdexcept>

#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>

namespace catgs::test {
namespace {

// std::mt19937_64 is the same everywhere; the standard's distributions are not.
class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}
  float uniform(float low, float high) {
    return low + (high - low) * static_cast<float>(engine_() >> 40) * 0x1p-24f;
  }
  glm::vec3 uniform3(float low, float high) {
    return {uniform(low, high), uniform(low, high), uniform(low, high)};
  }
  glm::quat rotation() {
    for (;;) {
      const glm::quat q(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1), uniform(-1, 1));
      const float norm = glm::length(q);
      if (norm > 0.1f && norm < 1.0f) return q / norm;
    }
  }

 private:
  std::mt19937_64 engine_;
};

struct Placed {
  glm::vec3 mean;
  glm::vec3 scale;
  float opacity = 0.8f;
  glm::vec3 colour{0.5f};
  glm::quat rotation{1, 0, 0, 0};
};

GaussianCloud cloud_of(const std::vector<Placed>& gaussians) {
  constexpr float sh_constant = 0.28209479f;
  GaussianCloud cloud;
  cloud.resize(gaussians.size(), 0);
  for (std::size_t i = 0; i < gaussians.size(); ++i) {
    const Placed& g = gaussians[i];
    cloud.mean[i] = g.mean;
    cloud.scale[i] = g.scale;
    cloud.rotation[i] = g.rotation;
    cloud.opacity[i] = g.opacity;
    cloud.sh[i] = (g.colour - 0.5f) / sh_constant;
  }
  return cloud;
}

TestScene scene(std::string name, GaussianCloud cloud, const Pose& pose, glm::ivec2 size_px,
                float focal_px, float near_z = 0.2f) {
  return {std::move(name),
          std::make_shared<const GaussianCloud>(std::move(cloud)),
          {make_camera(pose, size_px, focal_px, near_z), {0.1f, 0.2f, 0.3f}}};
}

/// A camera inside a cloud: Gaussians behind, on and just past the near plane.
GaussianCloud surrounding_cloud() {
  Random random(11);
  GaussianCloud cloud = random_cloud(600, 1, 12);
  for (glm::vec3& mean : cloud.mean) mean = random.uniform3(-1.5f, 1.5f);
  for (std::size_t i = 0; i < 40; ++i) cloud.mean[i].z = 0.2f + 1e-4f * static_cast<float>(i);
  return cloud;
}

GaussianCloud huge_gaussians() {
  Random random(21);
  std::vector<Placed> placed;
  for (int i = 0; i < 40; ++i)
    placed.push_back({random.uniform3(-20, 20) + glm::vec3(0, 0, 25), random.uniform3(1, 30),
                      random.uniform(0.02f, 0.95f), random.uniform3(0, 1), random.rotation()});
  return cloud_of(placed);
}

GaussianCloud needles() {
  Random random(31);
  std::vector<Placed> placed;
  for (int i = 0; i < 400; ++i)
    placed.push_back({random.uniform3(-2, 2) + glm::vec3(0, 0, 5),
                      {random.uniform(0.3f, 3.0f), 1e-4f, 1e-5f},
                      random.uniform(0.3f, 0.999f),
                      random.uniform3(0, 1),
                      random.rotation()});
  return cloud_of(placed);
}

/// Equal centres and equal depths: only the order of the scene decides.
GaussianCloud coincident_gaussians() {
  Random random(41);
  std::vector<Placed> placed;
  for (int i = 0; i < 300; ++i) {
    const glm::vec3 cell(static_cast<float>(i % 6) - 2.5f, static_cast<float>(i / 6 % 5) - 2.0f,
                         0.0f);
    placed.push_back({cell * 0.4f + glm::vec3(0, 0, 4), random.uniform3(0.05f, 0.4f), 0.9f,
                      random.uniform3(0, 1), random.rotation()});
  }
  return cloud_of(placed);
}

/// Opacities at both ends: just above and below visibility, and nearly opaque.
GaussianCloud faint_and_opaque() {
  GaussianCloud cloud = random_cloud(2000, 0, 51);
  Random random(52);
  for (float& opacity : cloud.opacity) {
    const float kind = random.uniform(0, 1);
    opacity = kind < 0.4f   ? random.uniform(0.0035f, 0.0045f)
              : kind < 0.8f ? random.uniform(0.004f, 0.02f)
                            : random.uniform(0.98f, 0.99999f);
  }
  return cloud;
}

/// Mostly smaller than a pixel, so that the low-pass filter takes most of their opacity.
GaussianCloud antialiased() {
  GaussianCloud cloud = random_cloud(4000, 1, 71);
  cloud.model = SplatModel::antialiased;
  for (glm::vec3& scale : cloud.scale) scale *= 0.2f;
  return cloud;
}

/// Discs as sanitize() leaves them.
GaussianCloud surfels() {
  GaussianCloud cloud = random_cloud(2000, 1, 81);
  cloud.model = SplatModel::surfels;
  for (glm::vec3& scale : cloud.scale) scale.z = 1e-3f * std::min(scale.x, scale.y);
  return cloud;
}

GaussianCloud far_from_origin() {
  GaussianCloud cloud = random_cloud(1500, 2, 61);
  for (glm::vec3& mean : cloud.mean) mean += glm::vec3(800, -300, 1200);
  return cloud;
}

}  // namespace

GaussianCloud random_cloud(std::size_t count, int degree, std::uint64_t seed) {
  Random random(seed);
  GaussianCloud cloud;
  cloud.resize(count, degree);
  for (std::size_t i = 0; i < count; ++i) {
    cloud.mean[i] = random.uniform3(-2.0f, 2.0f) + glm::vec3(0, 0, 5);
    const glm::vec3 logs = random.uniform3(-4.6f, -1.2f);
    cloud.scale[i] = glm::exp(logs);
    cloud.rotation[i] = random.rotation();
    cloud.opacity[i] = random.uniform(0.05f, 0.98f);
    for (int k = 0; k < cloud.sh_count(); ++k)
      cloud.sh[i * cloud.sh_count() + k] = random.uniform3(-1.5f, 1.5f) / static_cast<float>(k + 1);
  }
  return cloud;
}

std::vector<TestScene> small_scenes() {
  const Pose still;
  const Pose aside = look_at({1.5f, -0.7f, 0.5f}, {0.2f, 0.1f, 5.0f});
  std::vector<TestScene> scenes;
  scenes.push_back(scene("random_sh3", random_cloud(3000, 3, 1), aside, {160, 120}, 150));
  scenes.push_back(scene("random_sh1_odd_size", random_cloud(1000, 1, 2), still, {97, 53}, 80));
  scenes.push_back(scene("near_plane", surrounding_cloud(), still, {96, 64}, 60));
  scenes.push_back(scene("huge", huge_gaussians(), still, {128, 96}, 100));
  scenes.push_back(scene("needles", needles(), aside, {200, 150}, 400));
  scenes.push_back(scene("coincident", coincident_gaussians(), still, {96, 80}, 120));
  scenes.push_back(scene("faint_and_opaque", faint_and_opaque(), aside, {128, 72}, 110));
  scenes.push_back(scene("antialiased", antialiased(), aside, {160, 120}, 120));
  scenes.push_back(scene("surfels", surfels(), aside, {128, 96}, 110));
  scenes.push_back(scene("far_from_origin", far_from_origin(),
                         look_at({801, -300, 1199}, {800, -300, 1205}), {120, 90}, 110));
  scenes.push_back(scene("empty", GaussianCloud{}, still, {40, 24}, 50));
  scenes.push_back(scene("one_pixel", random_cloud(500, 0, 3), still, {1, 1}, 50));
  scenes.push_back(scene("one_gaussian", random_cloud(1, 3, 4), still, {33, 17}, 30));
  scenes.push_back(
      scene("behind", random_cloud(200, 0, 5), look_at({0, 0, 20}, {0, 0, 40}), {32, 32}, 30));

  TestScene off_centre =
      scene("off_centre_principal_point", random_cloud(1500, 2, 6), still, {110, 70}, 90);
  off_centre.request.camera.principal_point_px = {20.0f, 61.0f};
  off_centre.request.camera.focal_px = {90.0f, 140.0f};
  scenes.push_back(off_centre);
  return scenes;
}

Pose look_at(glm::vec3 position, glm::vec3 target, glm::vec3 down) {
  const glm::vec3 forward = glm::normalize(target - position);
  const glm::vec3 right = glm::normalize(glm::cross(down, forward));
  return {position, glm::quat_cast(glm::mat3(right, glm::cross(forward, right), forward))};
}

std::vector<float> copy_rgb(const FrameView& frame) {
  if (frame.format != PixelFormat::rgb_f32) throw std::logic_error("not an rgb_f32 frame");
  std::vector<float> rgb;
  for (int y = 0; y < frame.size_px.y; ++y) {
    const auto* row =
        reinterpret_cast<const float*>(frame.planes[0].data + frame.planes[0].stride_bytes * y);
    rgb.insert(rgb.end(), row, row + 3 * frame.size_px.x);
  }
  return rgb;
}

double psnr_db(const std::vector<float>& a, const std::vector<float>& b) {
  if (a.size() != b.size() || a.empty()) throw std::logic_error("images of different sizes");
  double sum = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i)
    sum += std::pow(static_cast<double>(a[i]) - static_cast<double>(b[i]), 2);
  if (sum == 0.0) return std::numeric_limits<double>::infinity();
  return -10.0 * std::log10(sum / static_cast<double>(a.size()));
}

}  // namespace catgs::test

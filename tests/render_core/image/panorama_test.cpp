#include "render_core/image/panorama.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <stdexcept>

#include <glm/geometric.hpp>
#include <gtest/gtest.h>

#include "render_core/math/look_at.h"

namespace catgs::test {
namespace {

/// A world at infinity whose colour tells the direction.
glm::vec3 sky(const glm::vec3& direction) { return 0.5f + 0.5f * direction; }

/// A picture of the sky. `tint` is added to the sides that look forward.
Image draw_sky(const FrameRequest& request, float tint = 0.0f) {
  const Camera& camera = request.camera;
  Image image{camera.size_px, {}};
  const glm::vec3 forward = camera.world_from_camera.orientation * glm::vec3(0, 0, 1);
  for (int y = 0; y < image.size_px.y; ++y)
    for (int x = 0; x < image.size_px.x; ++x) {
      const glm::vec2 at = (glm::vec2(x, y) + 0.5f - camera.principal_point_px) / camera.focal_px;
      const glm::vec3 rgb =
          sky(camera.world_from_camera.orientation * glm::normalize(glm::vec3(at, 1.0f)));
      for (int c = 0; c < 3; ++c) image.rgb.push_back(rgb[c] + (forward.z > 0.5f ? tint : 0.0f));
    }
  return image;
}

FrameRequest at(const Pose& pose) {
  FrameRequest request;
  request.camera.world_from_camera = pose;
  return request;
}

glm::vec3 pixel(const Image& image, int x, int y) {
  const float* rgb = image.row(y) + 3 * x;
  return {rgb[0], rgb[1], rgb[2]};
}

TEST(Panorama, EveryPixelShowsItsDirection) {
  constexpr float pi = std::numbers::pi_v<float>;
  ThreadPool pool(2);
  const Pose pose = look_at({1, 2, 3}, {4, 1, -2}, glm::normalize(glm::vec3(0.1f, -1.0f, 0.2f)));
  const glm::ivec2 size_px(512, 256);
  const Image image =
      draw_panorama(at(pose), size_px, pool, [](const FrameRequest& r) { return draw_sky(r); });
  ASSERT_EQ(image.size_px, size_px);
  float worst = 0.0f;
  for (int y = 0; y < size_px.y; ++y)
    for (int x = 0; x < size_px.x; ++x) {
      const float longitude = (static_cast<float>(x) + 0.5f) / 512.0f * 2.0f * pi - pi;
      const float down = (static_cast<float>(y) + 0.5f) / 256.0f * pi - pi / 2.0f;
      const glm::vec3 direction(std::cos(down) * std::sin(longitude), std::sin(down),
                                std::cos(down) * std::cos(longitude));
      const glm::vec3 error = glm::abs(pixel(image, x, y) - sky(pose.orientation * direction));
      worst = std::max({worst, error.x, error.y, error.z});
    }
  EXPECT_LT(worst, 1.0f / 510.0f);
}

TEST(Panorama, TheMiddleIsWhereTheCameraLooks) {
  ThreadPool pool(1);
  const Image image =
      draw_panorama(at({}), {256, 128}, pool, [](const FrameRequest& r) { return draw_sky(r); });
  EXPECT_GT(pixel(image, 128, 64).z, 0.999f);
  EXPECT_GT(pixel(image, 192, 64).x, 0.999f) << "to the right";
  EXPECT_LT(pixel(image, 128, 0).y, 0.001f) << "above the picture";
}

TEST(Panorama, EndsBetweenRows) {
  ThreadPool pool(1);
  const auto draw = [](const FrameRequest& r) { return draw_sky(r); };
  int rows = 0;
  draw_panorama(at({}), {64, 32}, pool, draw, [&] { ++rows; });
  EXPECT_EQ(rows, 7 * 32);
  const auto cancel = [&] {
    if (--rows == 100) throw std::runtime_error("cancelled");
  };
  EXPECT_THROW(draw_panorama(at({}), {64, 32}, pool, draw, cancel), std::runtime_error);
  EXPECT_EQ(rows, 100);
}

// Sides that differ fade into each other: no step from pixel to pixel.
TEST(Panorama, HasNoSeams) {
  ThreadPool pool(1);
  const auto draw = [&](float tint) {
    return draw_panorama(at({}), {512, 256}, pool,
                         [=](const FrameRequest& r) { return draw_sky(r, tint); });
  };
  constexpr float tint = 0.2f;
  const Image plain = draw(0.0f), tinted = draw(tint);
  float largest = 0.0f, step = 0.0f;
  for (int x = 1; x < 512; ++x) {
    const float here = pixel(tinted, x, 128).x - pixel(plain, x, 128).x;
    const float before = pixel(tinted, x - 1, 128).x - pixel(plain, x - 1, 128).x;
    largest = std::max(largest, here);
    step = std::max(step, std::abs(here - before));
  }
  EXPECT_NEAR(largest, tint, 1e-4f);
  EXPECT_LT(step, tint / 8.0f);
}

}  // namespace
}  // namespace catgs::test

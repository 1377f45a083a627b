// Cameras of eyes.
#include "render_core/math/stereo.h"

#include <limits>

#include <gtest/gtest.h>

#include "render_core/math/camera-inl.h"

namespace catgs {
namespace {

/// A head that has turned, with near plane and clip box of its own.
Camera head() {
  Camera camera;
  camera.world_from_camera = {{1.0f, -2.0f, 3.0f},
                              glm::angleAxis(0.7f, glm::normalize(glm::vec3(0.2f, 1.0f, -0.4f)))};
  camera.size_px = {2 * 640, 360};
  camera.near_z = 0.07f;
  camera.clip = clip_plane({0, 1, 0}, 2.0f);
  return camera;
}

/// The pixel of a point that lies `depth` before the eye, beside its axis by `slope` of that.
math::Vec2<double> pixel_at(const Camera& head, const Eye& eye, glm::dvec2 slope, double depth) {
  const auto model = math::make_camera_model(eye_camera(head, eye));
  const glm::dquat turn(head.world_from_camera.orientation);
  const glm::dvec3 at = glm::dvec3(head.world_from_camera.position) +
                        turn * glm::dvec3(glm::dvec2(eye.offset) + depth * slope, depth);
  return math::image_px(model, math::camera_from_world(model, {at.x, at.y, at.z}));
}

TEST(StereoCameras, TangentsAreTheSidesOfThePicture) {
  const Eye eye{{0.03f, -0.02f}, {-1.3f, -0.9f}, {0.8f, 1.1f}};
  for (const double depth : {0.5, 20.0}) {
    const auto low = pixel_at(head(), eye, eye.low, depth);
    EXPECT_NEAR(low.x, 0.0, 1e-3);
    EXPECT_NEAR(low.y, 0.0, 1e-3);
    const auto high = pixel_at(head(), eye, eye.high, depth);
    EXPECT_NEAR(high.x, 640.0, 1e-3);
    EXPECT_NEAR(high.y, 360.0, 1e-3);
  }
}

TEST(StereoCameras, EyesShareAllButOffsetAndLens) {
  const Eye eye{{-0.03f, 0.0f}, {-1.0f, -0.5f}, {0.5f, 0.75f}};
  const Camera camera = eye_camera(head(), eye);
  EXPECT_EQ(camera.size_px, glm::ivec2(640, 360));
  EXPECT_EQ(camera.near_z, head().near_z);
  EXPECT_EQ(camera.clip, head().clip);
  EXPECT_EQ(camera.world_from_camera.orientation, head().world_from_camera.orientation);
  const glm::vec3 step = camera.world_from_camera.position - head().world_from_camera.position;
  EXPECT_NEAR(glm::length(step), 0.03f, 1e-6f);
  const glm::vec3 axis = head().world_from_camera.orientation * glm::vec3(0, 0, 1);
  EXPECT_NEAR(glm::dot(step, axis), 0.0f, 1e-6f) << "depths are those of the head";
}

TEST(StereoCameras, EyesLikeALensSeeAsMuch) {
  Camera lens = make_camera({}, {640, 360}, 500.0f);
  lens.principal_point_px += glm::vec2(20.0f, -7.0f);
  const Stereo eyes = eyes_like(lens, 0.064f);
  for (const Eye& eye : eyes) {
    EXPECT_TRUE(is_valid(eye));
    const Camera camera = eye_camera(head(), eye);
    EXPECT_NEAR(camera.focal_px.x, 500.0f, 1e-3f);
    EXPECT_NEAR(camera.focal_px.y, 500.0f, 1e-3f);
    EXPECT_NEAR(camera.principal_point_px.x, 340.0f, 1e-3f);
    EXPECT_NEAR(camera.principal_point_px.y, 173.0f, 1e-3f);
  }
  EXPECT_FLOAT_EQ(eyes[1].offset.x - eyes[0].offset.x, 0.064f);
  EXPECT_LT(eyes[0].offset.x, 0.0f) << "the left one comes first";
}

TEST(StereoCameras, EyesHaveBounds) {
  const Eye good{{0.03f, 0.0f}, {-1.0f, -1.0f}, {1.0f, 1.0f}};
  EXPECT_TRUE(is_valid(good));
  const float infinite = std::numeric_limits<float>::infinity();
  const auto refused = [&](auto change) {
    Eye bad = good;
    change(bad);
    return !is_valid(bad);
  };
  EXPECT_TRUE(refused([&](Eye& e) { e.offset.y = infinite; }));
  EXPECT_TRUE(refused([](Eye& e) { e.offset.x = 2.0f * max_coordinate; }));
  EXPECT_TRUE(refused([](Eye& e) { e.low.x = 1.0f; }));
  EXPECT_TRUE(refused([](Eye& e) { e.high.y = -2.0f; }));
  EXPECT_TRUE(refused([](Eye& e) { e.low.y = -10.1f; }));
  EXPECT_TRUE(refused([&](Eye& e) { e.high.x = -infinite; }));
}

}  // namespace
}  // namespace catgs

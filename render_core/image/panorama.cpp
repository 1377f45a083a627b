#include "render_core/image/panorama.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <vector>

#include <glm/common.hpp>
#include <glm/trigonometric.hpp>
#include <glm/vec3.hpp>

#include "render_core/math/look_at.h"

namespace catgs {
namespace {

/// Half the field of view of a side, and the tangents between which it fades out.
const float half_fov_rad = glm::radians(50.0f);
const float outer = std::tan(half_fov_rad), inner = 1.0f / outer;

/// Axes of a side's camera: its right, down and forward in those of the panorama's camera.
struct Side {
  glm::vec3 right, down, forward;
};
constexpr std::array<Side, 6> sides = {{
    {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}},
    {{0, 0, -1}, {0, 1, 0}, {1, 0, 0}},
    {{-1, 0, 0}, {0, 1, 0}, {0, 0, -1}},
    {{0, 0, 1}, {0, 1, 0}, {-1, 0, 0}},
    {{1, 0, 0}, {0, 0, 1}, {0, -1, 0}},
    {{1, 0, 0}, {0, 0, -1}, {0, 1, 0}},
}};

/// The direction of pixel (x, y), in the camera's axes.
glm::vec3 direction_of(int x, int y, glm::ivec2 size_px) {
  constexpr float pi = std::numbers::pi_v<float>;
  const glm::vec2 size = size_px;
  const float longitude = 2.0f * pi * ((static_cast<float>(x) + 0.5f) / size.x - 0.5f);
  const float latitude = pi * (0.5f - (static_cast<float>(y) + 0.5f) / size.y);  // up
  return {std::cos(latitude) * std::sin(longitude), -std::sin(latitude),
          std::cos(latitude) * std::cos(longitude)};
}

/// Weight of a side at tangents (u, v) from its axis: 1 in its middle, 0 at its border, and as much
/// as the neighbour's where the two meet.
float weight_at(float u, float v) {
  const float at = std::max(std::abs(u), std::abs(v));
  const float t = std::clamp((outer - at) / (outer - inner), 0.0f, 1.0f);
  return t * t * (3.0f - 2.0f * t);
}

glm::vec3 sample(const Image& image, float x, float y) {
  const auto at = [&](int column, int row) {
    column = std::clamp(column, 0, image.size_px.x - 1);
    row = std::clamp(row, 0, image.size_px.y - 1);
    const float* rgb = image.row(row) + 3 * column;
    return glm::vec3(rgb[0], rgb[1], rgb[2]);
  };
  const float left = std::floor(x - 0.5f), top = std::floor(y - 0.5f);
  const int c = static_cast<int>(left), r = static_cast<int>(top);
  const float fx = x - 0.5f - left, fy = y - 0.5f - top;
  return glm::mix(glm::mix(at(c, r), at(c + 1, r), fx),
                  glm::mix(at(c, r + 1), at(c + 1, r + 1), fx), fy);
}

/// Adds what a side shows to row `y`, and its weights.
void add_row(const Image& picture, const Side& side, float focal_px, int y, Image& out,
             std::vector<float>& weights) {
  const std::size_t first = static_cast<std::size_t>(y) * static_cast<std::size_t>(out.size_px.x);
  const glm::vec2 centre = glm::vec2(picture.size_px) * 0.5f;
  for (int x = 0; x < out.size_px.x; ++x) {
    const glm::vec3 direction = direction_of(x, y, out.size_px);
    const float depth = glm::dot(direction, side.forward);
    if (depth <= 0.0f) continue;
    const float u = glm::dot(direction, side.right) / depth;
    const float v = glm::dot(direction, side.down) / depth;
    const float weight = weight_at(u, v);
    if (weight <= 0.0f) continue;
    const glm::vec3 rgb =
        weight * sample(picture, centre.x + focal_px * u, centre.y + focal_px * v);
    const std::size_t pixel = first + static_cast<std::size_t>(x);
    for (int channel = 0; channel < 3; ++channel) out.rgb[3 * pixel + channel] += rgb[channel];
    weights[pixel] += weight;
  }
}

}  // namespace

Pose levelled(const Pose& pose, const glm::vec3& up) {
  const glm::vec3 forward = pose.orientation * glm::vec3(0, 0, 1);
  const glm::vec3 ahead = forward - glm::dot(forward, up) * up;
  return look_at(pose.position, pose.position + ahead, up);
}

Image draw_panorama(const FrameRequest& request, glm::ivec2 size_px, ThreadPool& pool,
                    const std::function<Image(const FrameRequest&)>& draw,
                    const std::function<void()>& after_row) {
  assert(size_px.x == 2 * size_px.y);
  // As many pixels a radian in the middle of a side as at the equator.
  const float focal_px = static_cast<float>(size_px.x) / (2.0f * std::numbers::pi_v<float>);
  const int side_px = std::max(2, static_cast<int>(std::ceil(2.0f * focal_px * outer)));
  const std::size_t pixels =
      static_cast<std::size_t>(size_px.x) * static_cast<std::size_t>(size_px.y);
  Image out{size_px, std::vector<float>(3 * pixels)};
  std::vector<float> weights(pixels);
  const auto rows = static_cast<std::size_t>(size_px.y);
  const Pose& pose = request.camera.world_from_camera;
  for (const Side& side : sides) {
    FrameRequest of_side = request;
    const glm::mat3 axes(side.right, side.down, side.forward);
    of_side.camera =
        make_camera({pose.position, glm::normalize(pose.orientation * glm::quat_cast(axes))},
                    glm::ivec2(side_px), focal_px, request.camera.near_z);
    of_side.camera.clip = request.camera.clip;
    const Image picture = draw(of_side);
    pool.parallel_for(rows, [&](std::size_t y) {
      add_row(picture, side, focal_px, static_cast<int>(y), out, weights);
      after_row();
    });
  }
  pool.parallel_for(rows, [&](std::size_t y) {
    const auto width = static_cast<std::size_t>(size_px.x);
    for (std::size_t i = y * width; i < (y + 1) * width; ++i)
      for (std::size_t channel = 0; channel < 3; ++channel) out.rgb[3 * i + channel] /= weights[i];
    after_row();
  });
  return out;
}

}  // namespace catgs

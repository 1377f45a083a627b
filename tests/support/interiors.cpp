#include "tests/support/interiors.h"

#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/trigonometric.hpp>

#include "render_core/scene/scene.h"
#include "render_core/synth/painter.h"
#include "render_core/synth/shapes.h"

namespace catgs::test {
namespace {

using synth::at;
using synth::child;
using synth::Finish;
using synth::Painter;
using synth::Random;

constexpr std::uint64_t seed = 26;

const glm::vec3 plaster(0.55f, 0.52f, 0.46f), stone(0.36f, 0.33f, 0.29f), wood(0.30f, 0.17f, 0.08f);

void panel(Painter& p, const glm::vec3& corner, const glm::vec3& u, const glm::vec3& v,
           const glm::vec3& albedo, float mottle, std::uint64_t key) {
  const Finish finish{.albedo = albedo, .mottle = mottle};
  paint_patch(p, {corner, u, v}, finish, glm::length(glm::cross(u, v)), key);
}

void block(Painter& p, const glm::vec3& low, const glm::vec3& high, const glm::vec3& albedo,
           std::uint64_t key) {
  const glm::vec3 size = glm::abs(high - low);
  paint_box(p, glm::min(low, high), glm::max(low, high), {.albedo = albedo, .mottle = 0.2f},
            3.0 * (size.x * size.z + size.y * (size.x + size.z)), key);
}

/// Floor, ceiling and outer walls of a house from (0, 0) to (width, depth).
void shell(Painter& p, float width, float depth, float height, const glm::vec3& floor) {
  panel(p, at(0, 0, 0), {width, 0, 0}, {0, 0, depth}, floor, 0.4f, child(seed, 1));
  panel(p, at(0, height, 0), {width, 0, 0}, {0, 0, depth}, plaster, 0.1f, child(seed, 2));
  for (const float z : {0.0f, depth})
    panel(p, at(0, 0, z), {width, 0, 0}, {0, -height, 0}, plaster, 0.1f, child(seed, 3));
  for (const float x : {0.0f, width})
    panel(p, at(x, 0, 0), {0, 0, depth}, {0, -height, 0}, plaster, 0.1f, child(seed, 4));
}

/// Pictures on a wall from `from`, `step` apart.
void pictures(Painter& p, glm::vec3 from, const glm::vec3& step, int count) {
  Random random(child(seed, 5));
  const glm::vec3 along = 0.5f * step;
  for (int i = 0; i < count; ++i, from += step) {
    const glm::vec3 albedo{random.uniform(0, 0.6f), random.uniform(0, 0.6f),
                           random.uniform(0, 0.6f)};
    panel(p, from, along, {0, -0.35f * glm::length(step), 0}, albedo, 0.6f, random.bits());
  }
}

/// What training leaves in empty space: soft clouds and needles.
void floaters(Painter& p, const glm::vec3& low, const glm::vec3& high, double weight, float opacity,
              float size_m, std::uint64_t key) {
  const std::size_t count = p.take(weight);
  Random random(key);
  for (std::size_t i = 0; i < count; ++i) {
    const glm::vec3 t{random.uniform(), random.uniform(), random.uniform()};
    const glm::vec3 colour{random.uniform(), random.uniform(), random.uniform()};
    const glm::vec3 shape =
        random.chance(0.5f) ? glm::vec3(1.0f, 0.6f, 0.4f) : glm::vec3(3.0f, 0.1f, 0.05f);
    p.put({.mean = low + t * (high - low),
           .rotation = random_rotation(random),
           .scale = size_m * random.spread(0.7f) * shape,
           .opacity = opacity * random.uniform(0.3f, 1.0f),
           .colour = colour});
  }
}

template <class Content>
GaussianCloud paint(std::size_t count, const Content& content) {
  const synth::Light light(glm::normalize(glm::vec3(-0.4f, -0.8f, -0.4f)), seed);
  synth::Shadows shadows(light.to_sun());
  GaussianCloud cloud;
  cloud.resize(count, max_sh_degree);
  Painter painter(light, shadows, cloud, 0, count, 1.0);
  painter.divide(painter.take(1.0), content);
  return cloud;
}

}  // namespace

GaussianCloud hall(std::size_t gaussians) {
  constexpr float length = 39.0f, width = 12.0f, height = 8.0f;
  GaussianCloud cloud = paint(gaussians, [](Painter& p) {
    shell(p, length, width, height, stone);
    pictures(p, at(1, 1.5f, 0.05f), {4, 0, 0}, 9);
    pictures(p, at(1, 1.5f, width - 0.05f), {4, 0, 0}, 9);
    for (int i = 0; i < 7; ++i) {
      const float x = 3.0f + 5.5f * static_cast<float>(i);
      const auto key = static_cast<std::uint64_t>(10 * i);
      for (const float z : {2.0f, width - 2.6f})
        block(p, at(x, 0, z), at(x + 0.6f, height, z + 0.6f), stone, child(seed, 100 + key));
      block(p, at(x + 1, 0.4f, 4.5f), at(x + 1.6f, 0.5f, 7.5f), wood, child(seed, 101 + key));
      block(p, at(x + 1.5f, 0, 4.5f), at(x + 1.6f, 1, 7.5f), wood, child(seed, 102 + key));
    }
    floaters(p, at(0, height, 0), at(length, 0, width), 40.0, 0.03f, 0.15f, child(seed, 6));
    floaters(p, at(-30, 25, -30), at(length + 30, -5, -1), 60.0, 0.5f, 0.5f, child(seed, 7));
    floaters(p, at(-30, 25, width + 1), at(length + 30, -5, 42), 60.0, 0.5f, 0.5f, child(seed, 8));
  });
  for (glm::vec3& mean : cloud.mean) mean -= glm::vec3(0.5f * length, 0, 0.5f * width);
  return cloud;
}

GaussianCloud flat(std::size_t gaussians) {
  constexpr float width = 12.0f, depth = 9.0f, height = 2.6f;
  GaussianCloud cloud = paint(gaussians, [](Painter& p) {
    shell(p, width, depth, height, wood);
    // Two inner walls that cross, each with a door on both sides of the crossing.
    for (const float x : {0.0f, 7.0f}) {
      const float end = x > 0 ? width : 7.0f;
      panel(p, at(x, 0, 5), {end - x - 1, 0, 0}, {0, -height, 0}, plaster, 0.1f, child(seed, 10));
      panel(p, at(end - 1, 2, 5), {1, 0, 0}, {0, -0.6f, 0}, plaster, 0.1f, child(seed, 11));
    }
    for (const float z : {0.0f, 5.0f}) {
      const float end = z > 0 ? depth : 5.0f;
      panel(p, at(7, 0, z), {0, 0, end - z - 1}, {0, -height, 0}, plaster, 0.1f, child(seed, 12));
      panel(p, at(7, 2, end - 1), {0, 0, 1}, {0, -0.6f, 0}, plaster, 0.1f, child(seed, 13));
    }
    pictures(p, at(0.5f, 1.2f, 0.03f), {2, 0, 0}, 6);
    pictures(p, at(0.5f, 1.2f, depth - 0.03f), {2, 0, 0}, 6);
    for (int room = 0; room < 4; ++room) {
      const float x = room % 2 == 0 ? 2.0f : 8.5f, z = room < 2 ? 1.5f : 6.3f;
      const auto key = static_cast<std::uint64_t>(20 + 10 * room);
      block(p, at(x, 0.7f, z), at(x + 1.6f, 0.75f, z + 0.9f), wood, child(seed, key));
      for (const float leg : {0.0f, 1.5f})
        block(p, at(x + leg, 0, z), at(x + leg + 0.1f, 0.7f, z + 0.9f), stone,
              child(seed, key + 1));
      block(p, at(x - 1.8f, 0, z + 0.5f), at(x - 1.2f, 1.9f, z + 1.5f), {0.1f, 0.2f, 0.3f},
            child(seed, key + 2));
      block(p, at(x + 0.4f, 0, z + 1.2f), at(x + 0.9f, 0.45f, z + 1.7f), {0.4f, 0.1f, 0.1f},
            child(seed, key + 3));
    }
    floaters(p, at(0, height, 0), at(width, 0, depth), 8.0, 0.03f, 0.08f, child(seed, 14));
    floaters(p, at(-4, 5, -4), at(width + 4, height + 0.6f, depth + 4), 25.0, 0.6f, 0.1f,
             child(seed, 15));
  });
  const glm::quat z_up = glm::angleAxis(glm::radians(-90.0f), glm::vec3(1, 0, 0));
  for (std::size_t i = 0; i < cloud.size(); ++i) {
    cloud.mean[i] = z_up * cloud.mean[i];
    cloud.rotation[i] = z_up * cloud.rotation[i];
  }
  return cloud;
}

}  // namespace catgs::test

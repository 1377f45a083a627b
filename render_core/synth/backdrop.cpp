#include "render_core/synth/backdrop.h"

#include <algorithm>

#include <glm/geometric.hpp>

#include "render_core/synth/shapes.h"

namespace catgs::synth {
namespace {

/// Share of haze in front of a place, by its distance from the centre and the radius of the scene.
float haze_at(float distance, float radius) {
  return 0.93f * (1.0f - exp_exact(-distance / (1.6f * radius)));
}

/// Discs that cover the sky down to a little below the horizon, where they are densest because
/// people look there.
void paint_shell(Painter& painter, const glm::vec2& centre, float radius, double weight,
                 float overlap, std::uint64_t key) {
  const std::size_t count = painter.take(weight);
  Random random(key);
  const auto n = static_cast<float>(count);
  constexpr float lowest = -0.06f;
  constexpr float area = 6.2832f * (1.0f - lowest);  // steradians
  for (std::size_t i = 0; i < count; ++i) {
    // Heights follow t^1.5. Compared with an even spread, that is 1 / (1.5 sqrt(t)) as dense.
    const float t = (static_cast<float>(i) + 0.5f) / n;
    const float root = std::sqrt(t);
    const float height = lowest + (1.0f - lowest) * t * root;
    const float level = std::sqrt(std::max(0.0f, 1.0f - height * height));
    const SinCos turn = sin_cos_turns(static_cast<float>(i) * 0.61803399f);
    const glm::vec3 d(level * turn.cos, -height, level * turn.sin);
    const glm::vec3 helper = level > 0.1f ? up : glm::vec3(1, 0, 0);
    const glm::vec3 side = glm::normalize(glm::cross(d, helper));
    const float size = radius * std::sqrt(area * 1.5f * root / n) * overlap * random.spread(0.05f);
    painter.put({.mean = at(centre.x, 0.0f, centre.y) + d * radius,
                 .rotation = rotation_of(side, glm::cross(d, side)),
                 .scale = {size, size, 0.06f * size},
                 .opacity = random.uniform(0.965f, 0.99f),
                 .colour = painter.light().sky(d)});
  }
}

}  // namespace

void paint_sky(Painter& painter, const glm::vec2& centre, float radius, double weight,
               std::uint64_t key) {
  painter.divide(painter.take(weight), [&](Painter& p) {
    paint_shell(p, centre, radius, 0.94, 0.66f, child(key, 1));
    // A few wide discs behind them, so that no gap is black.
    paint_shell(p, centre, 1.06f * radius, 0.06, 0.9f, child(key, 2));
  });
}

void paint_horizon(Painter& painter, const glm::vec2& centre, float inner, float outer,
                   const glm::vec3& albedo, double weight, std::uint64_t key) {
  painter.divide(painter.take(weight), [&](Painter& p) {
    const Light& light = p.light();
    Random random(key);
    const std::size_t land = p.take(0.7);
    // Radii grow exponentially with t^2: fine where the land meets the place itself, so that no
    // disc covers what stands there, and wider with the distance.
    const float growth = outer > 4.0f * inner ? 3.7f : 2.3f;
    for (std::size_t i = 0; i < land; ++i) {
      const float t = (static_cast<float>(i) + 0.5f) / static_cast<float>(land);
      const float r = inner * exp_exact(growth * t * t);
      const float size =
          std::min(0.62f * r * std::sqrt(12.566f * growth * t / static_cast<float>(land)),
                   0.04f * inner + 0.33f * (r - inner));
      const SinCos turn = sin_cos_turns(static_cast<float>(i) * 0.61803399f);
      const glm::vec3 d(turn.cos, 0, turn.sin);
      const glm::vec3 colour = light.shade(albedo * random.spread(0.15f), {0, -1, 0}, 0.7f, 0.9f);
      p.put({.mean = at(centre.x + r * d.x, -0.3f - 0.05f * size, centre.y + r * d.z),
             .rotation = rotation_of({1, 0, 0}, {0, 0, -1}),
             .scale = {size, size, 0.03f * size},
             .opacity = 0.97f,
             .colour = blend(colour, light.haze(d), haze_at(r, inner))});
    }
    const std::size_t hills = p.take(0.3);
    const float far = outer * 0.93f;
    for (std::size_t i = 0; i < hills; ++i) {
      const float around = (static_cast<float>(i / 2) + 0.5f) / static_cast<float>((hills + 1) / 2);
      const SinCos turn = sin_cos_turns(around);
      const glm::vec3 d(turn.cos, 0, turn.sin);
      const float ridge = far * (0.03f + 0.06f * fractal_noise(key, turn.cos * 2.5f + 7.0f,
                                                               turn.sin * 2.5f + 7.0f, 4));
      const float width = far * 6.2832f / static_cast<float>((hills + 1) / 2);
      const bool upper = i % 2 == 1;
      const glm::vec3 hill(0.36f, 0.41f, 0.50f);
      p.put({.mean = at(centre.x + far * d.x, ridge * (upper ? 0.55f : 0.1f), centre.y + far * d.z),
             .rotation = rotation_of({-d.z, 0, d.x}, {0, -1, 0}),
             .scale = {width * 0.8f, ridge * 0.27f, width * 0.1f},
             .opacity = 0.96f,
             .colour = blend(hill, light.haze(d), 0.62f)});
    }
  });
}

void paint_skyline(Painter& painter, const glm::vec2& centre, float inner, float outer,
                   double weight, std::uint64_t key) {
  const std::size_t count = painter.take(weight);
  painter.divide(count, [&](Painter& p) {
    Random random(key);
    const int houses = std::min(420, 12 + static_cast<int>(count / 10));
    for (int i = 0; i < houses; ++i) {
      const float t = (static_cast<float>(i) + random.uniform()) / static_cast<float>(houses);
      const float r = inner + (outer - inner) * t;
      const SinCos turn =
          sin_cos_turns(static_cast<float>(i) * 0.61803399f + 0.01f * random.uniform());
      const glm::vec2 position = centre + r * glm::vec2(turn.cos, turn.sin);
      const float high =
          random.chance(0.10f) ? random.uniform(30.0f, 75.0f) : random.uniform(13.0f, 24.0f);
      const glm::vec2 half = glm::vec2{random.uniform(8.0f, 22.0f), random.uniform(8.0f, 22.0f)} *
                             (high > 30.0f ? 0.6f : 1.0f + t);
      const glm::vec3 wall =
          blend(glm::vec3(0.40f, 0.32f, 0.24f), glm::vec3(0.50f, 0.44f, 0.37f), random.uniform());
      const Finish finish{.albedo = wall,
                          .gloss_gain = 0.3f,
                          .sky_visibility = 0.8f,
                          .mottle = 0.2f,
                          .haze = haze_at(r, inner)};
      const double area =
          static_cast<double>(high) * (half.x + half.y) * 2.0 + half.x * half.y * 4.0;
      paint_box(p, at(position.x - half.x, high, position.y - half.y),
                at(position.x + half.x, 0.0f, position.y + half.y), finish, area / (1.0 + t),
                child(key, static_cast<std::uint64_t>(i)));
    }
  });
}

void paint_floaters(Painter& painter, const glm::vec3& min, const glm::vec3& max, double weight,
                    std::uint64_t key) {
  const std::size_t count = painter.take(weight);
  Random random(key);
  const glm::vec3 size = max - min;
  for (std::size_t i = 0; i < count; ++i) {
    const glm::vec3 t{random.uniform(), random.uniform(), random.uniform()};
    const glm::vec3 point = min + size * glm::vec3(t.x, 1.0f - t.y * t.y, t.z);
    const float scale = 0.16f * random.spread(0.6f);
    painter.put({.mean = point,
                 .rotation = random_rotation(random),
                 .scale = glm::vec3(1.0f, 0.6f, 0.35f) * scale,
                 .opacity = std::max(0.006f, 0.012f * random.spread(0.8f)),
                 .colour = blend(glm::vec3(0.95f, 0.82f, 0.62f), glm::vec3(0.70f, 0.72f, 0.78f),
                                 random.uniform()),
                 .lobe = &painter.light().lobe(Gloss::leaf, {0, -1, 0}),
                 .lobe_gain = 0.6f});
  }
}

}  // namespace catgs::synth

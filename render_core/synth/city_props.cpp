#include <array>

#include <glm/geometric.hpp>

#include "render_core/synth/city_parts.h"
#include "render_core/synth/shapes.h"

namespace catgs::synth {
namespace {

constexpr std::array<glm::vec3, 8> car_paints = {
    glm::vec3(0.55f, 0.55f, 0.54f), glm::vec3(0.035f, 0.035f, 0.04f),
    glm::vec3(0.62f, 0.60f, 0.56f), glm::vec3(0.34f, 0.04f, 0.03f),
    glm::vec3(0.05f, 0.10f, 0.24f), glm::vec3(0.20f, 0.21f, 0.22f),
    glm::vec3(0.50f, 0.36f, 0.08f), glm::vec3(0.07f, 0.16f, 0.12f)};

/// Small things stay recognisable where walls and ground are already coarse.
float prop_detail(const glm::vec2& position) {
  return glm::clamp(detail_at(position), 0.25f, 1.4f);
}

void paint_car(Painter& painter, const Car& car, float detail, float haze) {
  painter.divide(painter.take(170.0 * detail), [&](Painter& p) {
    Random random(car.key);
    const float direction = car.forward ? 1.0f : -1.0f;
    const glm::vec2 ahead = car.along_x ? glm::vec2(direction, 0) : glm::vec2(0, direction);
    const auto point = [&](float a, float height, float c) {
      return at(car.position.x + ahead.x * a - ahead.y * c, height,
                car.position.y + ahead.y * a + ahead.x * c);
    };
    const auto box = [&](float a0, float a1, float h0, float h1, float half, const Finish& f,
                         double w, std::uint64_t i) {
      const glm::vec3 a = point(a0, h0, -half), b = point(a1, h1, half);
      paint_box(p, glm::min(a, b), glm::max(a, b), f, w, child(car.key, i));
    };
    const glm::vec3 colour = car_paints[static_cast<std::size_t>(random.below(8))];
    const Finish paint{.albedo = colour,
                       .gloss = Gloss::paint,
                       .sky_visibility = 0.75f,
                       .mottle = 0.0f,
                       .haze = haze};
    const Finish glass{.albedo = glm::vec3(0.02f),
                       .gloss = Gloss::glass,
                       .gloss_gain = 0.7f,
                       .sky_visibility = 0.7f,
                       .haze = haze};
    const Finish tyre{.albedo = glm::vec3(0.02f), .sky_visibility = 0.3f, .haze = haze};
    const float length = random.uniform(1.95f, 2.25f);  // half of the length
    // The shadow under the car, which no box can cast.
    Finish dark{
        .albedo = glm::vec3(0.03f), .sky_visibility = 0.25f, .haze = haze, .opacity = 0.85f};
    const glm::vec3 corner = point(-length, 0.03f, -0.85f);
    const glm::vec3 u = point(length, 0.03f, -0.85f) - corner,
                    v = point(-length, 0.03f, 0.85f) - corner;
    paint_patch(p, {corner, u, v}, dark, 6.0, child(car.key, 1));
    box(-length, length, 0.32f, 0.86f, 0.88f, paint, 38.0, 2);
    box(-length * 0.62f, length * 0.34f, 0.86f, 1.32f, 0.72f, glass, 20.0, 3);
    const glm::vec3 roof = point(-length * 0.55f, 1.38f, -0.68f);
    paint_patch(p,
                {roof, point(length * 0.18f, 1.38f, -0.68f) - roof,
                 point(-length * 0.55f, 1.38f, 0.68f) - roof},
                paint, 5.0, child(car.key, 4));
    for (const float a : {-length * 0.62f, length * 0.62f}) {
      for (const float c : {-0.84f, 0.84f}) {
        paint_blob(p, point(a, 0.32f, c), {0.3f, 0.32f, 0.3f}, tyre, 3.0,
                   child(car.key, static_cast<std::uint64_t>(10.0f + a + 3.0f * c)));
      }
    }
    Finish lamp{.albedo = glm::vec3(0.5f), .haze = haze};
    for (const float c : {-0.6f, 0.6f}) {
      lamp.glow = {1.6f, 1.4f, 1.0f};
      paint_blob(p, point(length, 0.66f, c), {0.11f, 0.09f, 0.11f}, lamp, 1.2, child(car.key, 20));
      lamp.glow = {1.0f, 0.06f, 0.03f};
      paint_blob(p, point(-length, 0.70f, c), {0.10f, 0.09f, 0.10f}, lamp, 1.2, child(car.key, 21));
    }
  });
}

void paint_lamp(Painter& painter, const Lamp& lamp, float detail, float haze) {
  painter.divide(painter.take(24.0 * detail), [&](Painter& p) {
    const std::uint64_t key = 7;
    const Finish iron{
        .albedo = glm::vec3(0.05f, 0.055f, 0.05f), .sky_visibility = 0.8f, .haze = haze};
    const glm::vec2 end = lamp.position + lamp.arm * 1.3f;
    const glm::vec3 head = at(end.x, 5.6f, end.y);
    paint_line(p, at(lamp.position.x, 0.1f, lamp.position.y),
               at(lamp.position.x, 0.9f, lamp.position.y), 0.3f, iron, 1.5, key);
    paint_line(p, at(lamp.position.x, 0.9f, lamp.position.y),
               at(lamp.position.x, 5.8f, lamp.position.y), 0.15f, iron, 4.0, key);
    paint_line(p, at(lamp.position.x, 5.8f, lamp.position.y), head + glm::vec3(0, -0.25f, 0), 0.11f,
               iron, 2.0, key);
    const Finish light{.albedo = glm::vec3(0.6f), .glow = {2.4f, 1.7f, 0.8f}, .haze = haze};
    paint_blob(p, head, {0.24f, 0.2f, 0.24f}, light, 5.0, key);
    for (std::size_t halo = p.take(1.0); halo > 0; --halo) {
      p.put({.mean = head,
             .rotation = {1, 0, 0, 0},
             .scale = glm::vec3(0.7f),
             .opacity = 0.12f,
             .colour = {1.0f, 0.82f, 0.52f}});
    }
  });
}

void paint_person(Painter& painter, const glm::vec2& position, float detail, float haze,
                  std::uint64_t key) {
  painter.divide(painter.take(36.0 * detail), [&](Painter& p) {
    Random random(key);
    const float h = random.uniform(0.93f, 1.08f);
    const glm::vec3 coat = car_paints[static_cast<std::size_t>(random.below(8))] * 0.7f + 0.02f;
    const glm::vec3 trousers{random.uniform(0.02f, 0.16f), random.uniform(0.03f, 0.12f),
                             random.uniform(0.04f, 0.15f)};
    const Finish cloth{.albedo = coat, .sky_visibility = 0.75f, .haze = haze};
    const Finish legs{.albedo = trousers, .sky_visibility = 0.6f, .haze = haze};
    const Finish skin{.albedo = blend(glm::vec3(0.55f, 0.36f, 0.27f),
                                      glm::vec3(0.22f, 0.13f, 0.09f), random.uniform()),
                      .sky_visibility = 0.8f,
                      .haze = haze};
    const SinCos turn = sin_cos_turns(random.uniform());
    const glm::vec2 stride = glm::vec2(turn.cos, turn.sin) * random.uniform(0.08f, 0.26f);
    const glm::vec2 a = position + stride, b = position - stride;
    const float ground = 0.12f;
    paint_line(p, at(a.x, ground, a.y), at(position.x, ground + 0.86f * h, position.y), 0.17f, legs,
               2.5, child(key, 1));
    paint_line(p, at(b.x, ground, b.y), at(position.x, ground + 0.86f * h, position.y), 0.17f, legs,
               2.5, child(key, 2));
    paint_blob(p, at(position.x, ground + 1.14f * h, position.y), {0.21f, 0.33f * h, 0.21f}, cloth,
               6.0, child(key, 3));
    const glm::vec2 shoulder(-turn.sin * 0.24f, turn.cos * 0.24f);
    for (const float side : {-1.0f, 1.0f}) {
      const glm::vec2 s = position + shoulder * side;
      paint_line(p, at(s.x, ground + 1.38f * h, s.y),
                 at(s.x + stride.x * side * 0.6f, ground + 0.86f * h, s.y + stride.y * side * 0.6f),
                 0.11f, cloth, 1.5, child(key, 4));
    }
    paint_blob(p, at(position.x, ground + 1.62f * h, position.y), {0.11f, 0.14f, 0.11f}, skin, 3.0,
               child(key, 5));
  });
}

}  // namespace

void paint_props(Painter& painter, const Block& block, float haze) {
  if (!painter.measuring()) {
    const float x = block_pitch_m * static_cast<float>(block.column),
                z = block_pitch_m * static_cast<float>(block.row);
    painter.shadows().focus({at(x - 14, 6, z - 14), at(x + block_pitch_m, 0, z + block_pitch_m)});
  }
  for (const Car& car : block.cars) paint_car(painter, car, prop_detail(car.position), haze);
  for (const Lamp& lamp : block.lamps) paint_lamp(painter, lamp, prop_detail(lamp.position), haze);
  Random random(child(block.key, 80));
  const float x = block_pitch_m * static_cast<float>(block.column),
              z = block_pitch_m * static_cast<float>(block.row);
  const float west = 0.5f * street_width_x(block.column), south = 0.5f * street_width_z(block.row);
  for (int i = 0; i < 26; ++i) {
    const float along = random.uniform(6.0f, block_pitch_m - 14.0f);
    const float side = random.chance(0.5f) ? 1.0f : -1.0f;
    const bool on_west = random.chance(0.6f);
    const float half = on_west ? west : south;
    const float across = side * (half - random.uniform(0.7f, pavement_width(2.0f * half) - 1.2f));
    const glm::vec2 position = on_west ? glm::vec2(x + across, z + south + along * 0.8f)
                                       : glm::vec2(x + west + along * 0.8f, z + across);
    paint_person(painter, position, prop_detail(position), haze,
                 child(block.key, 1000 + static_cast<std::uint64_t>(i)));
  }
}

}  // namespace catgs::synth

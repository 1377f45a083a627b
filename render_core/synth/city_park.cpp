#include <array>

#include <glm/geometric.hpp>

#include "render_core/synth/city_ground.h"
#include "render_core/synth/city_parts.h"
#include "render_core/synth/plants.h"

namespace catgs::synth {
namespace {

constexpr double lawn_density = 3.2;  // Gaussians per square metre at detail 1, blades as many
constexpr double water_density = 4.0;
constexpr float path_half_width = 1.7f;
const glm::vec3 lawn_albedo(0.105f, 0.150f, 0.040f);
const glm::vec3 gravel_albedo(0.46f, 0.38f, 0.27f);

/// Grass in squares, each a patch of ground with blades on it.
void paint_lawn(Painter& p, const Ground& ground, float a0, float a1, float c0, float c1,
                std::uint64_t index) {
  constexpr int squares = 4;
  const Finish grass{
      .albedo = lawn_albedo, .sky_visibility = 0.85f, .mottle = 0.30f, .haze = ground.haze};
  const float da = (a1 - a0) / squares, dc = (c1 - c0) / squares;
  for (int i = 0; i < squares * squares; ++i) {
    const float a = a0 + da * static_cast<float>(i % squares);
    const float c = c0 + dc * static_cast<float>(i / squares);
    const Patch patch = ground.patch(a, a + da, c, c + dc);
    focus_on(p, patch);
    const double weight =
        lawn_density * ground.detail(a + 0.5f * da, c + 0.5f * dc) * static_cast<double>(da) * dc;
    const std::uint64_t key = child(child(ground.key, index), static_cast<std::uint64_t>(i));
    paint_patch(p, patch, grass, weight, child(key, 1), 0.62f);
    paint_blades(p, patch.corner, patch.u, patch.v, 0.22f, lawn_albedo * 1.3f, ground.haze, weight,
                 child(key, 2));
  }
}

/// A round pond and its stone rim.
void paint_pond(Painter& p, const Ground& ground, float radius, std::uint64_t key) {
  const float detail = ground.detail(0, 0);
  focus_on(p, ground.patch(-radius, radius, -radius, radius));
  const std::size_t count = p.take(water_density * detail * 3.14f * radius * radius);
  const Light& light = p.light();
  Random random(key);
  const auto n = static_cast<float>(count);
  for (std::size_t i = 0; i < count; ++i) {
    const float r = radius * std::sqrt((static_cast<float>(i) + 0.5f) / n);
    const SinCos turn = sin_cos_turns(static_cast<float>(i) * 0.61803399f);
    const glm::vec3 point = ground.point(r * turn.cos, r * turn.sin, 0.10f);
    const float size = radius * std::sqrt(3.14f / n) * 0.66f * random.spread(0.1f);
    const glm::vec3 deep = light.shade({0.02f, 0.035f, 0.035f}, up, 0.5f, 0.7f);
    p.put({.mean = point,
           .rotation = rotation_of({1, 0, 0}, {0, 0, -1}),
           .scale = {size * 1.1f, size, 0.05f * size},
           .opacity = 0.98f,
           .colour = blend(deep, light.haze(point), ground.haze),
           .lobe = &light.lobe(Gloss::water, up),
           .lobe_gain = (1.0f - ground.haze) * random.uniform(0.93f, 1.0f)});
  }
  const Finish rim{
      .albedo = glm::vec3(0.50f, 0.46f, 0.40f), .sky_visibility = 0.85f, .haze = ground.haze};
  constexpr int sides = 28;
  for (int i = 0; i < sides; ++i) {
    const SinCos a = sin_cos_turns(static_cast<float>(i) / sides);
    const SinCos b = sin_cos_turns(static_cast<float>(i + 1) / sides);
    const float r = radius + 0.25f;
    paint_line(p, ground.point(r * a.cos, r * a.sin, 0.2f),
               ground.point(r * b.cos, r * b.sin, 0.2f), 0.55f, rim, 6.0 * detail,
               child(key, static_cast<std::uint64_t>(i)));
  }
}

/// A ring of gravel around the pond, where the paths meet.
void paint_ring(Painter& p, const Ground& ground, float inner, float outer, std::uint64_t key) {
  const std::size_t count =
      p.take(pavement_density * ground.detail(0, 0) * 3.14f * (outer * outer - inner * inner));
  focus_on(p, ground.patch(-outer, outer, -outer, outer));
  Random random(key);
  const auto n = static_cast<float>(count);
  const float size = std::sqrt(3.14f * (outer * outer - inner * inner) / (n + 1.0f)) * 0.6f;
  for (std::size_t i = 0; i < count; ++i) {
    const float t = (static_cast<float>(i) + 0.5f) / n;
    const float r = std::sqrt(blend(inner * inner, outer * outer, t));
    const SinCos turn = sin_cos_turns(static_cast<float>(i) * 0.61803399f);
    const glm::vec3 point = ground.point(r * turn.cos, r * turn.sin, 0.05f);
    const float sun = p.shadows().sun_visibility(point);
    const glm::vec3 colour = p.light().shade(gravel_albedo * random.spread(0.05f), up, sun, 0.85f);
    p.put({.mean = point,
           .rotation = rotation_of({1, 0, 0}, {0, 0, -1}),
           .scale = {size, size, 0.06f * size},
           .opacity = 0.97f,
           .colour = blend(colour, p.light().haze(point), ground.haze),
           .lobe = &p.light().lobe(Gloss::matte, up)});
  }
}

/// Lawns between crossing paths, a round pond where they meet, beds of flowers along them.
void paint_park(Painter& p, const Block& block, float haze) {
  const glm::vec2 half = block.lot.size() * 0.5f;
  const Ground ground{block.lot.middle(), true, 0, 0, haze, child(block.key, 70)};
  const float w = path_half_width;
  paint_lawn(p, ground, -half.x, -w, -half.y, -w, 1);
  paint_lawn(p, ground, w, half.x, -half.y, -w, 2);
  paint_lawn(p, ground, -half.x, -w, w, half.y, 3);
  paint_lawn(p, ground, w, half.x, w, half.y, 4);
  const Finish gravel{
      .albedo = gravel_albedo, .sky_visibility = 0.85f, .mottle = 0.1f, .haze = haze};
  paint_rectangle(p, ground, -half.x, half.x, -w, w, gravel, pavement_density, 5);
  paint_rectangle(p, ground, -w, w, -half.y, -w, gravel, pavement_density, 6);
  paint_rectangle(p, ground, -w, w, w, half.y, gravel, pavement_density, 7);
  const float pond = pond_share * std::min(half.x, half.y);
  paint_ring(p, ground, pond, pond + 2.6f, child(ground.key, 8));
  paint_pond(p, ground, pond, child(ground.key, 9));
}

}  // namespace

void paint_lot(Painter& painter, const Block& block, float haze) {
  if (block.use == BlockUse::park) {
    paint_park(painter, block, haze);
    return;
  }
  const glm::vec2 half = block.lot.size() * 0.5f;
  Ground ground{block.lot.middle(), true, 0, 0, haze, child(block.key, 71)};
  if (block.use == BlockUse::houses) {  // a green court; the houses stand on the rest
    const Finish grass{
        .albedo = lawn_albedo, .sky_visibility = 0.5f, .mottle = 0.25f, .haze = haze};
    const float a = half.x - house_depth_m, c = half.y - house_depth_m;
    paint_rectangle(painter, ground, -a, a, -c, c, grass, 0.5 * lawn_density, 1, kerb_height);
    return;
  }
  paint_rectangle(painter, ground, -half.x, half.x, -half.y, half.y, ground.paving(0.85f),
                  0.8 * pavement_density, 1, kerb_height);
}

}  // namespace catgs::synth

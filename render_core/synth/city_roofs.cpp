#include <algorithm>
#include <array>

#include <glm/geometric.hpp>

#include "render_core/synth/city_wall.h"

namespace catgs::synth {
namespace {

constexpr double roof_density = 2.2;  // Gaussians per square metre at detail 1

/// A roof's extent: the walls below and how far each slope runs inwards.
struct RoofShape {
  float x0, x1, z0, z1;
  float eaves;
  float rise;  // 0: flat
  std::array<float, 4> inset;
};

RoofShape shape_of(const Building& b) {
  const glm::vec2 size = b.base.size();
  float run = 0.0f;
  if (b.roof == Roof::mansard) run = 1.5f;
  if (b.roof == Roof::hip || b.roof == Roof::spire) run = 0.499f * std::min(size.x, size.y);
  RoofShape shape{b.base.min.x, b.base.max.x, b.base.min.y, b.base.max.y, b.eaves(), 0.0f, {}};
  if (run > 0.0f) shape.rise = b.roof_height();
  for (std::size_t s = 0; s < 4; ++s) shape.inset[s] = b.sides[s] == SideUse::party ? 0.0f : run;
  return shape;
}

/// Slopes on the open sides; on party walls they stand upright and close the gable.
void paint_slopes(Painter& painter, const RoofShape& r, const Finish& tiles, double density,
                  std::uint64_t key) {
  const auto slope = [&](std::size_t side, const glm::vec3& corner, const glm::vec3& u,
                         const glm::vec3& inwards, float cut_start, float cut_end) {
    const glm::vec3 v = up * r.rise + inwards * r.inset[side];
    const float length = glm::length(u);
    const double area = glm::length(v) * (length - 0.5f * (cut_start + cut_end));
    paint_patch(painter, {corner, u, v, cut_start / length, cut_end / length}, tiles,
                density * 1.6 * area + 1.0, child(key, side));
  };
  const float width = r.x1 - r.x0, depth = r.z1 - r.z0;
  const auto& in = r.inset;
  slope(0, at(r.x0, r.eaves, r.z1), {0, 0, -depth}, {1, 0, 0}, in[3], in[2]);
  slope(1, at(r.x1, r.eaves, r.z0), {0, 0, depth}, {-1, 0, 0}, in[2], in[3]);
  slope(2, at(r.x0, r.eaves, r.z0), {width, 0, 0}, {0, 0, 1}, in[0], in[1]);
  slope(3, at(r.x1, r.eaves, r.z1), {-width, 0, 0}, {0, 0, -1}, in[1], in[0]);
}

void paint_parapet(Painter& painter, const RoofShape& r, const Finish& coping, double density,
                   std::uint64_t key) {
  const float h = r.eaves + 0.45f;
  const std::array<glm::vec3, 5> corners = {at(r.x0, h, r.z0), at(r.x1, h, r.z0), at(r.x1, h, r.z1),
                                            at(r.x0, h, r.z1), at(r.x0, h, r.z0)};
  for (std::size_t s = 0; s < 4; ++s) {
    const float length = glm::distance(corners[s], corners[s + 1]);
    paint_line(painter, corners[s], corners[s + 1], 0.9f, coping, 4.0 + density * length * 1.5,
               child(key, s));
  }
}

/// Chimneys on a pitched roof; stair heads and ventilation on a flat one.
void paint_roof_things(Painter& painter, const RoofShape& r, double density, float haze,
                       std::uint64_t key) {
  Random random(key);
  const bool chimneys = r.rise > 0.0f;
  const int things = 2 + random.below(3);
  const Finish body{
      .albedo = chimneys ? glm::vec3(0.36f, 0.21f, 0.15f) : glm::vec3(0.38f, 0.38f, 0.37f),
      .sky_visibility = 0.9f,
      .haze = haze};
  for (int i = 0; i < things; ++i) {
    const float width = chimneys ? 0.7f : random.uniform(1.2f, 3.2f);
    const float depth = chimneys ? 1.3f : random.uniform(1.2f, 2.8f);
    const float foot = r.eaves + 0.35f * r.rise;
    const float top = r.eaves + r.rise + (chimneys ? 1.1f : 0.6f) * random.uniform(1.0f, 2.2f);
    const float x = random.uniform(r.x0 + 1.2f, r.x1 - 1.2f - width);
    const float z = random.uniform(r.z0 + 1.2f, r.z1 - 1.2f - depth);
    paint_box(painter, at(x, top, z), at(x + width, foot, z + depth), body, density * 14.0,
              child(key, static_cast<std::uint64_t>(i)));
  }
}

}  // namespace

void paint_roof(Painter& painter, const Building& b, const Palette& palette, float detail,
                float haze) {
  const RoofShape r = shape_of(b);
  const double density = roof_density * detail;
  const bool mansard = b.roof == Roof::mansard;
  Finish cover{.albedo = palette.roof,
               .gloss = mansard ? Gloss::paint : Gloss::matte,
               .gloss_gain = 0.22f,
               .sky_visibility = 0.95f,
               .mottle = 0.16f,
               .haze = haze};
  if (r.rise > 0.0f) paint_slopes(painter, r, cover, density, child(b.key, 500));
  const glm::vec2 low(r.x0 + r.inset[0], r.z0 + r.inset[2]);
  const glm::vec2 span = glm::vec2(r.x1 - r.inset[1], r.z1 - r.inset[3]) - low;
  if (span.x > 0.5f && span.y > 0.5f) {
    cover.albedo = {0.27f, 0.255f, 0.24f};
    cover.gloss = Gloss::matte;
    paint_patch(painter, {at(low.x, r.eaves + r.rise, low.y), {span.x, 0, 0}, {0, 0, span.y}},
                cover, density * 0.7 * span.x * span.y + 1.0, child(b.key, 501));
  }
  if (r.rise == 0.0f) {
    const Finish coping{.albedo = palette.trim, .sky_visibility = 0.9f, .haze = haze};
    paint_parapet(painter, r, coping, density, child(b.key, 502));
  }
  if (b.roof != Roof::spire) paint_roof_things(painter, r, density, haze, child(b.key, 503));
}

void paint_dormers(Painter& painter, const Wall& wall, float detail) {
  const Building& b = wall.building;
  const int count = std::max(1, static_cast<int>(std::floor(wall.length / 3.4f)));
  const float step = wall.length / static_cast<float>(count);
  for (int i = 0; i < count; ++i) {
    const std::uint64_t key = child(wall.key, 600 + static_cast<std::uint64_t>(i));
    const std::size_t n = painter.take(34.0 * detail);
    painter.divide(n, [&](Painter& p) {
      Random random(key);
      const float a = (static_cast<float>(i) + 0.5f) * step - 0.65f;
      const float h = b.eaves() + 0.5f;
      const Finish zinc = wall.finish({0.24f, 0.25f, 0.27f}, 16.0f);
      const Finish trim = wall.finish(wall.palette.trim, 16.0f, 0.02f);
      paint_patch(p, wall.patch(a + 0.2f, h + 0.15f, 0.9f, 1.35f, -0.15f),
                  pane_finish(wall, random, 16.0f, 0.2f), 3.0, child(key, 1), 0.5f);
      paint_line(p, wall.point(a + 0.1f, h, -0.1f), wall.point(a + 0.1f, h + 1.6f, -0.1f), 0.22f,
                 trim, 2.0, child(key, 2));
      paint_line(p, wall.point(a + 1.2f, h, -0.1f), wall.point(a + 1.2f, h + 1.6f, -0.1f), 0.22f,
                 trim, 2.0, child(key, 3));
      paint_line(p, wall.point(a, h + 1.7f, -0.05f), wall.point(a + 1.3f, h + 1.7f, -0.05f), 0.28f,
                 trim, 2.0, child(key, 4));
      paint_patch(
          p, {wall.point(a, h + 1.75f, 0.0f), wall.along * 1.3f, wall.normal * -1.3f + up * 0.1f},
          zinc, 2.5, child(key, 5));
    });
  }
}

}  // namespace catgs::synth

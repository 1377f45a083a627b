#include "render_core/scene/synth/city_streets.h"

#include <algorithm>

#include <glm/geometric.hpp>

#include "render_core/scene/synth/plants.h"
#include "render_core/scene/synth/shapes.h"

namespace catgs::synth {
namespace {

constexpr double road_density = 1.6;  // Gaussians per square metre at detail 1
constexpr double pavement_density = 2.2;
constexpr float kerb_height = 0.12f;
constexpr float zebra_start = 1.0f;  // from the crossing's edge
constexpr float zebra_width = 3.2f;
const glm::vec3 asphalt_albedo(0.155f, 0.15f, 0.148f);
const glm::vec3 paving_albedo(0.40f, 0.365f, 0.32f);
const glm::vec3 line_albedo(0.70f, 0.68f, 0.62f);

/// A street seen along its axis: `a` metres along, `c` metres across from its middle.
struct Street {
  glm::vec2 origin;
  bool along_x;
  float length;
  float width;
  float detail;
  float haze;
  std::uint64_t key;

  [[nodiscard]] glm::vec3 point(float a, float c, float height) const {
    return along_x ? at(origin.x + a, height, origin.y + c)
                   : at(origin.x + c, height, origin.y + a);
  }
  /// The ground from (a0, c0) to (a1, c1), facing up.
  [[nodiscard]] Patch ground(float a0, float a1, float c0, float c1, float height = 0.0f) const {
    const glm::vec3 corner = point(a0, c0, height);
    const glm::vec3 u = point(a1, c0, height) - corner;
    const glm::vec3 v = point(a0, c1, height) - corner;
    // cross(x, z) points up.
    return along_x ? Patch{corner, u, v} : Patch{corner, v, u};
  }
  [[nodiscard]] Finish asphalt() const {
    return {.albedo = asphalt_albedo,
            .gloss = Gloss::asphalt,
            .sky_visibility = 0.78f,
            .mottle = 0.07f,
            .haze = haze};
  }
  [[nodiscard]] Finish line() const {
    return {.albedo = line_albedo,
            .gloss = Gloss::asphalt,
            .gloss_gain = 0.5f,
            .sky_visibility = 0.78f,
            .mottle = 0.10f,
            .haze = haze};
  }
};

void paint_rectangle(Painter& p, const Street& s, float a0, float a1, float c0, float c1,
                     const Finish& finish, double density, std::uint64_t index, float height = 0.0f,
                     float overlap = 0.56f) {
  const double area = static_cast<double>(a1 - a0) * (c1 - c0);
  paint_patch(p, s.ground(a0, a1, c0, c1, height), finish, density * s.detail * area,
              child(s.key, index), overlap);
}

/// White bars with asphalt between them, from kerb to kerb.
void paint_zebra(Painter& p, const Street& s, float a0, float a1, float kerb, std::uint64_t index) {
  const int bars = static_cast<int>(std::floor(2.0f * kerb / 1.0f));
  const float pitch = 2.0f * kerb / static_cast<float>(bars);
  for (int i = 0; i < bars; ++i) {
    const float c = -kerb + pitch * static_cast<float>(i);
    const std::uint64_t key = index + 2 * static_cast<std::uint64_t>(i);
    paint_rectangle(p, s, a0, a1, c, c + pitch * 0.5f, s.asphalt(), 2.2 * road_density, key, 0.0f,
                    0.48f);
    paint_rectangle(p, s, a0, a1, c + pitch * 0.5f, c + pitch, s.line(), 2.2 * road_density,
                    key + 1, 0.0f, 0.46f);
  }
}

/// A strip of road with a line of dashes in it (or an unbroken one).
void paint_dashes(Painter& p, const Street& s, float a0, float a1, float c, bool broken,
                  std::uint64_t index) {
  const float half = 0.09f;
  const int pieces = std::max(1, static_cast<int>(std::floor((a1 - a0) / 3.0f)));
  const float step = (a1 - a0) / static_cast<float>(pieces);
  for (int i = 0; i < pieces; ++i) {
    const float a = a0 + step * static_cast<float>(i);
    const bool white = !broken || i % 2 == 1;
    paint_patch(p, s.ground(a, a + step, c - half, c + half), white ? s.line() : s.asphalt(),
                (white ? 3.0 : 1.5) * std::min(1.0f, 0.3f + s.detail),
                child(s.key, index + static_cast<std::uint64_t>(i)), 0.5f);
  }
}

void paint_carriageway(Painter& p, const Street& s, float kerb) {
  const float start = zebra_start + zebra_width + 1.2f;
  const float end = s.length - start;
  const Finish asphalt = s.asphalt();
  for (const bool far : {false, true}) {
    const float edge = far ? s.length : 0.0f;
    const float sign = far ? -1.0f : 1.0f;
    const auto ordered = [&](float a, float b, const auto& paint) {
      paint(std::min(a, b), std::max(a, b));
    };
    const std::uint64_t base = far ? 2000 : 1000;
    ordered(edge, edge + sign * zebra_start, [&](float a, float b) {
      paint_rectangle(p, s, a, b, -kerb, kerb, asphalt, road_density, base);
    });
    ordered(edge + sign * zebra_start, edge + sign * (zebra_start + zebra_width),
            [&](float a, float b) { paint_zebra(p, s, a, b, kerb, base + 10); });
    ordered(edge + sign * (zebra_start + zebra_width), edge + sign * (start - 0.45f),
            [&](float a, float b) {
              paint_rectangle(p, s, a, b, -kerb, kerb, asphalt, road_density, base + 200);
            });
    ordered(edge + sign * (start - 0.45f), edge + sign * start,
            [&](float a, float b) {  // stop line on the right-hand half
              paint_rectangle(p, s, a, b, far == s.along_x ? 0.0f : -kerb,
                              far == s.along_x ? kerb : 0.0f, s.line(), 3.0 * road_density,
                              base + 201, 0.0f, 0.5f);
              paint_rectangle(p, s, a, b, far == s.along_x ? -kerb : 0.0f,
                              far == s.along_x ? 0.0f : kerb, asphalt, road_density, base + 202);
            });
  }
  const bool avenue = kerb > 6.0f;
  const float lane = avenue ? 2.9f : kerb - 2.3f;
  std::vector<float> lines = {-kerb + 2.25f, 0.0f, kerb - 2.25f};
  if (avenue) lines = {-kerb + 2.25f, -lane, 0.0f, lane, kerb - 2.25f};
  float from = -kerb;
  for (std::size_t i = 0; i <= lines.size(); ++i) {
    const float to = i < lines.size() ? lines[i] - 0.09f : kerb;
    paint_rectangle(p, s, start, end, from, to, asphalt, road_density, 300 + i, 0.0f, 0.52f);
    if (i < lines.size()) {
      const bool middle = lines[i] == 0.0f;
      paint_dashes(p, s, start, end, lines[i], !(middle && avenue), 400 + 100 * i);
      from = lines[i] + 0.09f;
    }
  }
}

void paint_street(Painter& p, const Street& s) {
  const float pavement = pavement_width(s.width);
  const float kerb = s.width * 0.5f - pavement;
  paint_carriageway(p, s, kerb);
  const Finish stone{.albedo = glm::vec3(0.52f, 0.49f, 0.44f),
                     .sky_visibility = 0.75f,
                     .mottle = 0.05f,
                     .haze = s.haze};
  for (const float side : {-1.0f, 1.0f}) {
    Finish slabs{.albedo = paving_albedo, .sky_visibility = 0.74f, .mottle = 0.10f, .haze = s.haze};
    const std::uint64_t base = side < 0.0f ? 20 : 30;
    const float outer = side * s.width * 0.5f, inner = side * kerb;
    const float wall_strip = outer - side * 0.9f;
    slabs.sky_visibility = 0.55f;  // where the pavement meets the wall
    paint_rectangle(p, s, 0, s.length, std::min(outer, wall_strip), std::max(outer, wall_strip),
                    slabs, pavement_density, base, kerb_height);
    slabs.sky_visibility = 0.74f;
    paint_rectangle(p, s, 0, s.length, std::min(inner, wall_strip), std::max(inner, wall_strip),
                    slabs, pavement_density, base + 1, kerb_height);
    paint_line(p, s.point(0, inner, kerb_height * 0.6f),
               s.point(s.length, inner, kerb_height * 0.6f), 0.24f, stone,
               1.1 * s.length * s.detail, child(s.key, base + 2));
  }
}

}  // namespace

void paint_streets(Painter& painter, const Block& block, float detail, float haze) {
  const float x = block_pitch_m * static_cast<float>(block.column);
  const float z = block_pitch_m * static_cast<float>(block.row);
  const float west = street_width_x(block.column), south = street_width_z(block.row);
  const float east = street_width_x(block.column + 1), north = street_width_z(block.row + 1);
  if (!painter.measuring()) {
    painter.shadows().focus(
        {at(x - west, 0.5f, z - south), at(x + block_pitch_m, 0, z + block_pitch_m)});
  }
  const Street along_z{
      {x, z + 0.5f * south}, false, block_pitch_m - 0.5f * (south + north), west, detail, haze,
      child(block.key, 60)};
  const Street along_x{
      {x + 0.5f * west, z}, true, block_pitch_m - 0.5f * (west + east), south, detail, haze,
      child(block.key, 61)};
  paint_street(painter, along_z);
  paint_street(painter, along_x);
  // The crossing: asphalt between the kerbs, rounded off by pavement in its corners.
  const float kerb_x = 0.5f * west - pavement_width(west),
              kerb_z = 0.5f * south - pavement_width(south);
  const Street crossing{{x, z}, true, 0.0f, 0.0f, detail, haze, child(block.key, 62)};
  paint_rectangle(painter, crossing, -0.5f * west, 0.5f * west, -kerb_z, kerb_z, crossing.asphalt(),
                  road_density, 1);
  for (const float side : {-1.0f, 1.0f}) {
    const float c0 = std::min(side * kerb_z, side * 0.5f * south),
                c1 = std::max(side * kerb_z, side * 0.5f * south);
    paint_rectangle(painter, crossing, -kerb_x, kerb_x, c0, c1, crossing.asphalt(), road_density,
                    side < 0 ? 2 : 3);
    const Finish slabs{
        .albedo = paving_albedo, .sky_visibility = 0.75f, .mottle = 0.10f, .haze = haze};
    paint_rectangle(painter, crossing, -0.5f * west, -kerb_x, c0, c1, slabs, pavement_density,
                    side < 0 ? 4 : 5, kerb_height);
    paint_rectangle(painter, crossing, kerb_x, 0.5f * west, c0, c1, slabs, pavement_density,
                    side < 0 ? 6 : 7, kerb_height);
  }
}

namespace {

const glm::vec3 lawn_albedo(0.115f, 0.165f, 0.045f);

/// Lawns between crossing paths, a round pond where they meet.
void paint_park(Painter& p, const Block& block, float detail, float haze) {
  const glm::vec2 middle = block.lot.middle();
  const glm::vec2 half = block.lot.size() * 0.5f;
  const float path = 1.7f;
  const Finish grass{.albedo = lawn_albedo, .sky_visibility = 0.85f, .mottle = 0.22f, .haze = haze};
  const Finish gravel{.albedo = glm::vec3(0.46f, 0.38f, 0.27f),
                      .sky_visibility = 0.85f,
                      .mottle = 0.08f,
                      .haze = haze};
  const Street ground{middle, true, 0, 0, detail, haze, child(block.key, 70)};
  std::uint64_t index = 0;
  for (const float sx : {-1.0f, 1.0f}) {
    for (const float sz : {-1.0f, 1.0f}) {
      const float a0 = sx < 0 ? -half.x : path, a1 = sx < 0 ? -path : half.x;
      const float c0 = sz < 0 ? -half.y : path, c1 = sz < 0 ? -path : half.y;
      paint_rectangle(p, ground, a0, a1, c0, c1, grass, 1.5, ++index);
      paint_blades(p, ground.point(a0, c0, 0), {a1 - a0, 0, 0}, {0, 0, c1 - c0}, 0.28f,
                   lawn_albedo * 1.25f, 1.6 * detail * static_cast<double>((a1 - a0) * (c1 - c0)),
                   child(ground.key, ++index));
    }
  }
  const float pond = 0.42f * half.x;
  paint_rectangle(p, ground, -half.x, half.x, -path, path, gravel, 1.8, ++index);
  paint_rectangle(p, ground, -path, path, -half.y, -path, gravel, 1.8, ++index);
  paint_rectangle(p, ground, -path, path, path, half.y, gravel, 1.8, ++index);
  // Rings of water over the crossing, a stone rim around them.
  const std::size_t count = p.take(3.0 * detail * 3.14f * pond * pond);
  const Light& light = p.light();
  Random random(child(ground.key, ++index));
  for (std::size_t i = 0; i < count; ++i) {
    const float r = pond * std::sqrt((static_cast<float>(i) + 0.5f) / static_cast<float>(count));
    const SinCos turn = sin_cos_turns(static_cast<float>(i) * 0.61803399f);
    const glm::vec3 point = at(middle.x + r * turn.cos, 0.06f, middle.y + r * turn.sin);
    const float size =
        pond * std::sqrt(3.14f / static_cast<float>(count)) * 0.62f * random.spread(0.1f);
    p.put({.mean = point,
           .rotation = rotation_of({1, 0, 0}, {0, 0, -1}),
           .scale = {size * 1.1f, size, 0.05f * size},
           .opacity = 0.975f,
           .colour = blend(light.shade({0.03f, 0.05f, 0.05f}, {0, -1, 0}, 0.6f, 0.9f),
                           light.haze(point), haze),
           .lobe = &light.lobe(Gloss::water, {0, -1, 0}),
           .lobe_gain = (1.0f - haze) * random.uniform(0.93f, 1.0f)});
  }
  const Finish rim{.albedo = glm::vec3(0.52f, 0.48f, 0.42f), .sky_visibility = 0.85f, .haze = haze};
  constexpr int sides = 24;
  for (int i = 0; i < sides; ++i) {
    const SinCos a = sin_cos_turns(static_cast<float>(i) / sides),
                 b = sin_cos_turns(static_cast<float>(i + 1) / sides);
    const float r = pond + 0.25f;
    paint_line(p, at(middle.x + r * a.cos, 0.2f, middle.y + r * a.sin),
               at(middle.x + r * b.cos, 0.2f, middle.y + r * b.sin), 0.6f, rim, 4.0 * detail,
               child(ground.key, ++index));
  }
}

}  // namespace

void paint_lot(Painter& painter, const Block& block, float detail, float haze) {
  const Rect& lot = block.lot;
  if (!painter.measuring())
    painter.shadows().focus({at(lot.min.x, 1.0f, lot.min.y), at(lot.max.x, 0, lot.max.y)});
  if (block.use == BlockUse::park) {
    paint_park(painter, block, detail, haze);
    return;
  }
  const bool court = block.use == BlockUse::houses;
  const float inset = court ? 12.5f : 0.0f;  // the houses stand on the rest
  Finish ground{.albedo = court ? lawn_albedo : paving_albedo * 1.05f,
                .sky_visibility = court ? 0.55f : 0.85f,
                .mottle = 0.15f,
                .haze = haze};
  const glm::vec2 size = lot.size() - 2.0f * inset;
  paint_patch(
      painter,
      {at(lot.min.x + inset, kerb_height, lot.min.y + inset), {size.x, 0, 0}, {0, 0, size.y}},
      ground, (court ? 0.7 : 1.6) * detail * size.x * size.y, child(block.key, 71));
}

}  // namespace catgs::synth

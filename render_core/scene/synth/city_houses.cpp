#include "render_core/scene/synth/city_houses.h"

#include <algorithm>
#include <array>

#include <glm/geometric.hpp>

#include "render_core/scene/synth/shapes.h"

namespace catgs::synth {
namespace {

constexpr double facade_density = 12.0;  // Gaussians per square metre at detail 1
constexpr double court_density = 3.0;
constexpr double roof_density = 2.2;

struct Palette {
  glm::vec3 wall, trim, shutter, roof;
};

constexpr std::array<glm::vec3, 9> stucco_walls = {
    glm::vec3(0.62f, 0.47f, 0.28f), glm::vec3(0.56f, 0.45f, 0.30f), glm::vec3(0.58f, 0.33f, 0.20f),
    glm::vec3(0.60f, 0.42f, 0.33f), glm::vec3(0.57f, 0.50f, 0.38f), glm::vec3(0.56f, 0.44f, 0.28f),
    glm::vec3(0.60f, 0.43f, 0.35f), glm::vec3(0.56f, 0.41f, 0.28f), glm::vec3(0.52f, 0.25f, 0.17f)};
constexpr std::array<glm::vec3, 4> stone_walls = {
    glm::vec3(0.50f, 0.42f, 0.31f), glm::vec3(0.54f, 0.46f, 0.35f), glm::vec3(0.50f, 0.45f, 0.38f),
    glm::vec3(0.56f, 0.50f, 0.41f)};
constexpr std::array<glm::vec3, 3> brick_walls = {glm::vec3(0.36f, 0.15f, 0.095f),
                                                  glm::vec3(0.42f, 0.20f, 0.12f),
                                                  glm::vec3(0.30f, 0.15f, 0.11f)};
constexpr std::array<glm::vec3, 5> shutters = {
    glm::vec3(0.045f, 0.085f, 0.07f), glm::vec3(0.07f, 0.10f, 0.14f),
    glm::vec3(0.17f, 0.06f, 0.04f), glm::vec3(0.15f, 0.13f, 0.11f), glm::vec3(0.30f, 0.27f, 0.22f)};
constexpr std::array<glm::vec3, 6> awnings = {
    glm::vec3(0.45f, 0.07f, 0.05f), glm::vec3(0.07f, 0.20f, 0.14f), glm::vec3(0.09f, 0.14f, 0.30f),
    glm::vec3(0.60f, 0.52f, 0.40f), glm::vec3(0.55f, 0.30f, 0.07f), glm::vec3(0.28f, 0.08f, 0.14f)};

template <std::size_t n>
const glm::vec3& pick(const std::array<glm::vec3, n>& colours, Random& random) {
  return colours[static_cast<std::size_t>(random.below(static_cast<int>(n)))];
}

Palette palette_of(const Building& b) {
  Random random(child(b.key, 100));
  Palette p;
  p.wall = b.style == Style::stone   ? pick(stone_walls, random)
           : b.style == Style::brick ? pick(brick_walls, random)
                                     : pick(stucco_walls, random);
  if (b.style == Style::curtain) p.wall = {0.16f, 0.19f, 0.22f};
  p.trim = blend(p.wall, glm::vec3(0.62f, 0.56f, 0.46f), 0.65f);
  p.shutter = pick(shutters, random);
  p.roof = b.roof == Roof::hip       ? blend(glm::vec3(0.36f, 0.15f, 0.08f),
                                             glm::vec3(0.46f, 0.22f, 0.12f), random.uniform())
           : b.roof == Roof::mansard ? glm::vec3(0.14f, 0.15f, 0.18f)
           : b.roof == Roof::spire   ? glm::vec3(0.13f, 0.23f, 0.20f)  // copper
                                     : glm::vec3(0.30f, 0.29f, 0.27f);
  return p;
}

/// One wall of a building: an origin at its foot, metres along and up.
struct Wall {
  const Building& building;
  const Palette& palette;
  glm::vec3 foot;
  glm::vec3 along;  // unit
  glm::vec3 normal;
  float length;
  SideUse use;
  float haze;
  std::uint64_t key;

  [[nodiscard]] glm::vec3 point(float a, float height, float out = 0.0f) const {
    return foot + along * a + up * height + normal * out;
  }
  [[nodiscard]] Patch patch(float a, float height, float width, float tall,
                            float out = 0.0f) const {
    return {point(a, height, out), along * width, up * tall};
  }
  /// Streets are darker below than above.
  [[nodiscard]] float openness(float height) const {
    return 0.50f + 0.42f * smooth_step(0.0f, 16.0f, height);
  }
  [[nodiscard]] Finish finish(const glm::vec3& albedo, float height, float mottle = 0.07f) const {
    return {.albedo = albedo, .sky_visibility = openness(height), .mottle = mottle, .haze = haze};
  }
};

/// What one sees in a window: its glass, and a room that may be lit.
Finish pane_finish(const Wall& wall, Random& random, float height, float lit_chance) {
  Finish f = wall.finish({0.025f, 0.028f, 0.033f}, height, 0.25f);
  f.gloss = Gloss::glass;
  f.gloss_gain = random.uniform(0.65f, 1.0f);
  const float u = random.uniform();
  if (u < lit_chance) {
    f.glow = glm::vec3(0.95f, 0.52f, 0.20f) * random.uniform(0.45f, 1.25f);
    f.gloss_gain *= 0.5f;
  } else if (u < lit_chance + 0.12f) {
    f.albedo = {0.30f, 0.28f, 0.25f};  // curtains
    f.gloss_gain *= 0.6f;
  }
  return f;
}

struct Bay {
  float start, width, window_start, window_width;
  float floor, height, sill, window_height;
};

/// The joinery of a window: frame, ledge, and with a larger budget its glazing bars.
void paint_frame(Painter& p, const Wall& wall, float x0, float x1, float y0, float y1, bool bars,
                 std::uint64_t key) {
  const Finish trim = wall.finish(wall.palette.trim, y0, 0.02f);
  paint_line(p, wall.point(x0 - 0.12f, y0 - 0.06f, 0.08f),
             wall.point(x1 + 0.12f, y0 - 0.06f, 0.08f), 0.16f, trim, 1.6, child(key, 1));
  paint_line(p, wall.point(x0, y1, 0.03f), wall.point(x1, y1, 0.03f), 0.13f, trim, 1.2,
             child(key, 2));
  paint_line(p, wall.point(x0, y0, 0.02f), wall.point(x0, y1, 0.02f), 0.1f, trim, 1.2,
             child(key, 3));
  paint_line(p, wall.point(x1, y0, 0.02f), wall.point(x1, y1, 0.02f), 0.1f, trim, 1.2,
             child(key, 4));
  if (!bars) return;
  const Finish white = wall.finish({0.50f, 0.48f, 0.44f}, y0, 0.0f);
  const float middle = (x0 + x1) * 0.5f, rail = y0 + 0.68f * (y1 - y0);
  paint_line(p, wall.point(middle, y0, -0.04f), wall.point(middle, y1, -0.04f), 0.06f, white, 1.5,
             child(key, 5));
  paint_line(p, wall.point(x0, rail, -0.04f), wall.point(x1, rail, -0.04f), 0.06f, white, 1.2,
             child(key, 6));
}

/// Wall around one window, its glass, and as much joinery as the budget of `budget` Gaussians
/// allows. The pieces tile the bay: one lying on another would be hidden by it from the side, where
/// whichever centre is nearer comes first.
void paint_bay(Painter& p, const Wall& wall, const Bay& bay, float budget, std::uint64_t key) {
  Random random(key);
  const bool framed = budget >= 12.0f;
  const bool shuttered =
      wall.building.style == Style::stucco && (wall.building.key & 3) != 0 && budget >= 10.0f;
  const double fine = std::max(0.0f, budget - (framed ? 14.0f : 7.0f)) / (bay.width * bay.height);
  const auto piece = [&](const Finish& finish, float a, float h, float width, float tall,
                         double least, std::uint64_t index, float out = 0.0f) {
    paint_patch(p, wall.patch(a, h, width, tall, out), finish, least + fine * width * tall,
                child(key, index), 0.57f);
  };
  const float x0 = bay.window_start, x1 = x0 + bay.window_width;
  const float shutter =
      shuttered ? std::min(0.5f * bay.window_width, x0 - bay.start - 0.15f) : 0.0f;
  const float left = x0 - shutter, right = x1 + shutter, end = bay.start + bay.width;
  const float y0 = bay.floor + bay.sill, y1 = y0 + bay.window_height;
  const Finish plaster = wall.finish(wall.palette.wall, bay.floor);
  piece(plaster, bay.start, bay.floor, left - bay.start, bay.height, 2, 1);
  piece(plaster, right, bay.floor, end - right, bay.height, 2, 2);
  piece(plaster, left, bay.floor, right - left, bay.sill, 1, 3);
  piece(plaster, left, y1, right - left, bay.floor + bay.height - y1, 1, 4);
  piece(pane_finish(wall, random, bay.floor, 0.16f), x0, y0, bay.window_width, bay.window_height,
        2.6, 5, -0.08f);
  if (shuttered) {
    const Finish wood = wall.finish(wall.palette.shutter, bay.floor, 0.1f);
    piece(wood, left, y0, shutter, y1 - y0, 1.5, 6, 0.04f);
    piece(wood, x1, y0, shutter, y1 - y0, 1.5, 7, 0.04f);
  }
  if (framed) paint_frame(p, wall, x0, x1, y0, y1, budget >= 17.0f, child(key, 8));
}

/// A storey as a band of glass and a band of wall: from far away that is what remains of it.
void paint_coarse_storey(Painter& p, const Wall& wall, float floor, float height,
                         std::uint64_t key) {
  Finish plaster = wall.finish(wall.palette.wall, floor);
  Finish band = wall.finish(blend(wall.palette.wall, glm::vec3(0.03f), 0.55f), floor, 0.15f);
  band.gloss = Gloss::glass;
  band.gloss_gain = 0.3f;
  paint_patch(p, wall.patch(0, floor, wall.length, height * 0.45f), plaster, 0.45 * height,
              child(key, 1));
  paint_patch(p, wall.patch(0, floor + height * 0.45f, wall.length, height * 0.55f), band,
              0.55 * height, child(key, 2));
}

void paint_storeys(Painter& p, const Wall& wall, float budget_per_m2) {
  const Building& b = wall.building;
  Random random(child(b.key, 101));
  const bool curtain = b.style == Style::curtain;
  const float bay_width = curtain ? 2.4f : random.uniform(2.5f, 3.1f);
  const int bays = std::max(1, static_cast<int>(std::floor(wall.length / bay_width + 0.5f)));
  const float width = wall.length / static_cast<float>(bays);
  const float window = curtain ? width - 0.25f : std::min(width - 0.9f, random.uniform(1.1f, 1.4f));
  const float sill = curtain ? 0.35f : random.uniform(0.45f, 0.9f);
  const float tall =
      curtain ? b.floor_height - 0.5f : std::min(b.floor_height - sill - 0.5f, 1.95f);
  const float budget = budget_per_m2 * width * b.floor_height;
  for (int floor = 0; floor < b.floors; ++floor) {
    const float base = b.ground_height + static_cast<float>(floor) * b.floor_height;
    const std::uint64_t storey = child(wall.key, 200 + static_cast<std::uint64_t>(floor));
    if (budget < 5.0f) {
      paint_coarse_storey(p, wall, base, b.floor_height, storey);
      continue;
    }
    for (int i = 0; i < bays; ++i) {
      const float start = static_cast<float>(i) * width;
      const Bay bay{start, width, start + 0.5f * (width - window), window, base, b.floor_height,
                    sill,  tall};
      const std::size_t n = p.take(bay.width * bay.height);
      const std::uint64_t key = child(storey, static_cast<std::uint64_t>(i));
      p.divide(n, [&](Painter& q) { paint_bay(q, wall, bay, static_cast<float>(n), key); });
    }
  }
}

/// Shop fronts between pilasters, a sign above each, awnings over some.
void paint_shops(Painter& p, const Wall& wall) {
  const float height = wall.building.ground_height;
  const int shops = std::max(1, static_cast<int>(std::floor(wall.length / 4.2f + 0.5f)));
  const float width = wall.length / static_cast<float>(shops);
  const Finish stone = wall.finish(blend(wall.palette.trim, wall.palette.wall, 0.4f), 0.0f);
  paint_patch(p, wall.patch(0, height - 0.55f, wall.length, 0.55f), stone, wall.length * 0.7,
              child(wall.key, 300));
  for (int i = 0; i < shops; ++i) {
    const std::uint64_t key = child(wall.key, 310 + static_cast<std::uint64_t>(i));
    Random random(key);
    const float a = static_cast<float>(i) * width;
    const float front = height - 1.2f;
    paint_patch(p, wall.patch(a, 0, 0.5f, height - 0.55f, 0.05f), stone, 2.2, child(key, 1));
    // What is on display below, the lit room above it.
    const float glow = random.chance(0.75f) ? random.uniform(0.25f, 0.7f) : 0.05f;
    Finish glass = pane_finish(wall, random, 0.0f, 0.0f);
    glass.mottle = 0.5f;
    glass.albedo = pick(awnings, random) * 0.5f;
    glass.glow = pick(awnings, random) * (0.3f * glow) + glm::vec3(0.10f, 0.06f, 0.02f) * glow;
    const float split = 0.55f + 0.42f * (front - 0.55f);
    paint_patch(p, wall.patch(a + 0.5f, 0.55f, width - 0.5f, split - 0.55f, -0.1f), glass, 5.0,
                child(key, 2), 0.62f);
    glass.albedo = {0.04f, 0.035f, 0.03f};
    glass.glow = glm::vec3(0.85f, 0.47f, 0.18f) * glow;
    paint_patch(p, wall.patch(a + 0.5f, split, width - 0.5f, front - split, -0.1f), glass, 5.0,
                child(key, 8), 0.62f);
    const glm::vec3 paint = pick(awnings, random);
    const Finish panel = wall.finish(paint * 0.7f, 0.0f);
    paint_patch(p, wall.patch(a + 0.5f, 0, width - 0.5f, 0.55f, -0.02f), panel, 2.5, child(key, 3));
    paint_patch(p, wall.patch(a + 0.5f, front, width - 0.5f, 0.65f, 0.05f),
                wall.finish(paint, 2.0f, 0.03f), 3.5, child(key, 4), 0.5f);
    if (random.chance(0.55f)) {
      const Patch awning{wall.point(a + 0.4f, front - 0.35f, 1.35f), wall.along * (width - 0.4f),
                         up * 0.55f - wall.normal * 1.3f};
      paint_patch(p, awning, wall.finish(pick(awnings, random), 5.0f, 0.03f), 7.0, child(key, 5));
      continue;
    }
    Finish frame = wall.finish({0.10f, 0.09f, 0.08f}, 0.0f);
    const float door = a + width * random.uniform(0.3f, 0.8f);
    paint_line(p, wall.point(door, 0.1f), wall.point(door, front), 0.1f, frame, 1.5, child(key, 6));
    paint_line(p, wall.point(door + 0.95f, 0.1f), wall.point(door + 0.95f, front), 0.1f, frame, 1.5,
               child(key, 7));
  }
}

/// Ledges between storeys, the cornice, and iron balconies along one or two floors.
void paint_ledges(Painter& p, const Wall& wall) {
  const Building& b = wall.building;
  if (b.style == Style::curtain) return;
  const Finish trim = wall.finish(wall.palette.trim, 10.0f, 0.03f);
  const double per_line = wall.length * 0.55;
  paint_line(p, wall.point(0, b.ground_height, 0.12f),
             wall.point(wall.length, b.ground_height, 0.12f), 0.3f, trim, per_line,
             child(wall.key, 400));
  paint_line(p, wall.point(0, b.eaves() - 0.15f, 0.25f),
             wall.point(wall.length, b.eaves() - 0.15f, 0.25f), 0.5f, trim, per_line,
             child(wall.key, 401));
  Random random(child(b.key, 102));
  if (wall.use != SideUse::street || random.chance(0.35f)) return;
  const Finish iron = wall.finish({0.03f, 0.03f, 0.035f}, 8.0f, 0.0f);
  for (const int floor : {1, b.floors - 1}) {
    if (floor >= b.floors) continue;
    const float h = b.ground_height + static_cast<float>(floor) * b.floor_height;
    const std::uint64_t key = child(wall.key, 410 + static_cast<std::uint64_t>(floor));
    const float end = wall.length - 0.4f;
    paint_line(p, wall.point(0.4f, h, 0.4f), wall.point(end, h, 0.4f), 0.22f, trim, per_line,
               child(key, 1));
    paint_line(p, wall.point(0.4f, h + 0.95f, 0.7f), wall.point(end, h + 0.95f, 0.7f), 0.08f, iron,
               per_line, child(key, 2));
    Finish railing = iron;
    railing.opacity = 0.42f;
    paint_patch(p, wall.patch(0.4f, h + 0.1f, end - 0.4f, 0.85f, 0.7f), railing, per_line * 1.2,
                child(key, 3));
  }
}

void paint_wall(Painter& painter, const Wall& wall, float bottom, float detail) {
  const Building& b = wall.building;
  if (wall.use == SideUse::party) {
    const float tall = b.eaves() - bottom;
    if (tall > 0.1f) {
      paint_patch(painter, wall.patch(0, bottom, wall.length, tall),
                  wall.finish(wall.palette.wall * 0.85f, bottom, 0.12f),
                  court_density * detail * wall.length * tall, wall.key);
    }
    return;
  }
  const float area = wall.length * b.eaves();
  const double density = (wall.use == SideUse::street ? facade_density : court_density) * detail;
  const std::size_t count = painter.take(density * area);
  const float per_m2 = static_cast<float>(count) / area;
  painter.divide(count, [&](Painter& p) {
    const double ground_area = wall.length * b.ground_height;
    if (wall.use == SideUse::street && per_m2 > 0.6f) {
      const std::size_t ground = p.take(ground_area * 1.1);
      p.divide(ground, [&](Painter& q) { paint_shops(q, wall); });
    } else {
      paint_patch(p, wall.patch(0, 0, wall.length, b.ground_height),
                  wall.finish(wall.palette.wall * 0.8f, 0.0f), ground_area, child(wall.key, 2));
    }
    if (per_m2 > 0.8f) {
      const std::size_t ledges = p.take(0.09 * area);
      p.divide(ledges, [&](Painter& q) { paint_ledges(q, wall); });
    }
    const std::size_t storeys = p.take(area - ground_area);
    const float upper = static_cast<float>(storeys) / static_cast<float>(area - ground_area);
    p.divide(storeys, [&](Painter& q) { paint_storeys(q, wall, upper); });
  });
}

/// Slopes on the open sides, gables on party walls, a flat top where the slopes leave one.
void paint_roof(Painter& painter, const Building& b, const Palette& palette, float detail,
                float haze) {
  const glm::vec2 size = b.base.size();
  const float e = b.eaves();
  const float rise = b.roof_height();
  const float run = b.roof == Roof::mansard ? 1.5f
                                            : (b.roof == Roof::hip || b.roof == Roof::spire
                                                   ? 0.499f * std::min(size.x, size.y)
                                                   : 0.0f);
  std::array<float, 4> inset{};
  for (std::size_t s = 0; s < 4; ++s) inset[s] = b.sides[s] == SideUse::party ? 0.0f : run;
  const float x0 = b.base.min.x, x1 = b.base.max.x, z0 = b.base.min.y, z1 = b.base.max.y;
  const Finish tiles{.albedo = palette.roof,
                     .gloss = b.roof == Roof::mansard ? Gloss::paint : Gloss::matte,
                     .gloss_gain = 0.45f,
                     .sky_visibility = 0.95f,
                     .mottle = 0.16f,
                     .haze = haze};
  const double density = roof_density * detail;
  const bool flat = run == 0.0f;
  const float top = flat ? e : e + rise;
  if (!flat) {
    const auto slope = [&](std::size_t side, const glm::vec3& corner, const glm::vec3& u,
                           const glm::vec3& v, float cut_start, float cut_end) {
      const float length = glm::length(u);
      const double area = length * glm::length(v) * (1.0f - 0.5f * (cut_start + cut_end) / length);
      paint_patch(painter, {corner, u, v, cut_start / length, cut_end / length}, tiles,
                  density * 1.6 * area + 1.0, child(b.key, 500 + side), 0.6f);
    };
    const glm::vec3 lift = up * rise;
    slope(0, at(x0, e, z1), {0, 0, z0 - z1}, lift + glm::vec3(inset[0], 0, 0), inset[3], inset[2]);
    slope(1, at(x1, e, z0), {0, 0, z1 - z0}, lift - glm::vec3(inset[1], 0, 0), inset[2], inset[3]);
    slope(2, at(x0, e, z0), {x1 - x0, 0, 0}, lift + glm::vec3(0, 0, inset[2]), inset[0], inset[1]);
    slope(3, at(x1, e, z1), {x0 - x1, 0, 0}, lift - glm::vec3(0, 0, inset[3]), inset[1], inset[0]);
  }
  const glm::vec2 low(x0 + inset[0], z0 + inset[2]);
  const glm::vec2 high(x1 - inset[1], z1 - inset[3]);
  const glm::vec2 span = high - low;
  if (span.x > 0.5f && span.y > 0.5f) {
    Finish deck = tiles;
    deck.albedo = {0.30f, 0.28f, 0.26f};
    deck.gloss = Gloss::matte;
    paint_patch(painter, {at(low.x, top, low.y), {span.x, 0, 0}, {0, 0, span.y}}, deck,
                density * 0.7 * span.x * span.y + 1.0, child(b.key, 510), 0.62f);
  }
  if (flat) {  // a parapet
    const Finish coping{.albedo = palette.trim, .sky_visibility = 0.9f, .haze = haze};
    const float h = e + 0.45f;
    const std::array<glm::vec3, 5> corners = {at(x0, h, z0), at(x1, h, z0), at(x1, h, z1),
                                              at(x0, h, z1), at(x0, h, z0)};
    for (std::size_t s = 0; s < 4; ++s) {
      paint_line(painter, corners[s], corners[s + 1], 0.9f, coping, 4.0 + density * size.x * 1.5,
                 child(b.key, 511 + s));
    }
  }
  if (b.roof == Roof::spire) return;
  // Chimneys, stair heads, ventilation.
  Random random(child(b.key, 515));
  const int things = 2 + random.below(3);
  for (int i = 0; i < things; ++i) {
    const bool chimney = !flat;
    const glm::vec3 s = chimney ? glm::vec3(0.7f, random.uniform(1.6f, 2.4f), 1.3f)
                                : glm::vec3(random.uniform(1.2f, 3.2f), random.uniform(0.9f, 2.4f),
                                            random.uniform(1.2f, 2.8f));
    const float x = random.uniform(x0 + 1.2f, x1 - 1.2f - s.x);
    const float z = random.uniform(z0 + 1.2f, z1 - 1.2f - s.z);
    const float foot = chimney ? e + rise * 0.35f : e;
    const Finish body{
        .albedo = chimney ? glm::vec3(0.40f, 0.24f, 0.17f) : glm::vec3(0.42f, 0.42f, 0.41f),
        .sky_visibility = 0.9f,
        .haze = haze};
    paint_box(painter, at(x, foot + s.y + (chimney ? rise * 0.65f : 0.0f), z),
              at(x + s.x, foot, z + s.z), body, density * 14.0,
              child(b.key, 520 + static_cast<std::uint64_t>(i)));
  }
}

/// Windows that stand out of the steep part of a mansard roof.
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

}  // namespace

void paint_building(Painter& painter, const Building& b, float detail, float haze) {
  const Palette palette = palette_of(b);
  if (!painter.measuring()) {
    painter.shadows().focus(
        {at(b.base.min.x - 1, b.eaves() + b.roof_height() + 3, b.base.min.y - 1),
         at(b.base.max.x + 1, 0, b.base.max.y + 1)});
  }
  const float x0 = b.base.min.x, x1 = b.base.max.x, z0 = b.base.min.y, z1 = b.base.max.y;
  // Along runs so that cross(along, up) faces out.
  const std::array<std::array<glm::vec3, 4>, 4> walls = {
      {{at(x0, 0, z1), {0, 0, -1}, {-1, 0, 0}, {}},
       {at(x1, 0, z0), {0, 0, 1}, {1, 0, 0}, {}},
       {at(x0, 0, z0), {1, 0, 0}, {0, 0, -1}, {}},
       {at(x1, 0, z1), {-1, 0, 0}, {0, 0, 1}, {}}}};
  for (std::size_t s = 0; s < 4; ++s) {
    const float length = s < 2 ? z1 - z0 : x1 - x0;
    const Wall wall{b,      palette,    walls[s][0], walls[s][1],        walls[s][2],
                    length, b.sides[s], haze,        child(b.key, s + 1)};
    paint_wall(painter, wall, b.neighbour_eaves[s], detail);
    if (b.roof == Roof::mansard && wall.use == SideUse::street)
      paint_dormers(painter, wall, detail);
  }
  paint_roof(painter, b, palette, detail, haze);
}

}  // namespace catgs::synth

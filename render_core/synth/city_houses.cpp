#include <algorithm>
#include <array>

#include <glm/geometric.hpp>

#include "render_core/synth/city_parts.h"
#include "render_core/synth/city_wall.h"

namespace catgs::synth {
namespace {

constexpr double facade_density = 12.0;  // Gaussians per square metre at detail 1
constexpr double court_density = 3.0;

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
           : b.roof == Roof::mansard ? glm::vec3(0.085f, 0.095f, 0.12f)
           : b.roof == Roof::spire   ? glm::vec3(0.13f, 0.23f, 0.20f)  // copper
                                     : glm::vec3(0.30f, 0.29f, 0.27f);
  return p;
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

/// Wall around one window, its glass, and as much joinery as a budget of `budget` Gaussians allows.
/// The pieces tile the bay without overlap. Where two overlapped, the one with the nearer centre
/// would hide the other in a view from the side.
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

/// A storey as a band of glass and a band of wall, as it looks from far away.
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
    // Goods on display below, the lit room above.
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
    if (per_m2 > 0.8f && b.style != Style::curtain) {
      const std::size_t ledges = p.take(0.09 * area);
      p.divide(ledges, [&](Painter& q) { paint_ledges(q, wall); });
    }
    const std::size_t storeys = p.take(area - ground_area);
    const float upper = static_cast<float>(storeys) / static_cast<float>(area - ground_area);
    p.divide(storeys, [&](Painter& q) { paint_storeys(q, wall, upper); });
  });
}

}  // namespace

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

void paint_building(Painter& painter, const Building& b, float detail, float haze) {
  const Palette palette = palette_of(b);
  if (!painter.measuring()) {
    painter.shadows().focus(
        {at(b.base.min.x - 1, b.eaves() + b.roof_height() + 3, b.base.min.y - 1),
         at(b.base.max.x + 1, 0, b.base.max.y + 1)});
  }
  const float x0 = b.base.min.x, x1 = b.base.max.x, z0 = b.base.min.y, z1 = b.base.max.y;
  // Wall directions, such that cross(along, up) points outwards.
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

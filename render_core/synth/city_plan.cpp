#include "render_core/synth/city_plan.h"

#include <algorithm>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "render_core/synth/painter.h"
#include "render_core/synth/random.h"

namespace catgs::synth {
namespace {

BlockUse use_of(std::uint64_t key, int column, int row) {
  if ((column == -1 || column == -2) && (row == 0 || row == 1)) return BlockUse::park;
  if (column == -1 && row == 2) return BlockUse::square;
  if (std::abs(column) <= 1 && row >= -1 && row <= 2) return BlockUse::houses;
  Random random(child(key, 1));
  // A cluster of towers beyond the end of the avenue.
  const float dx = static_cast<float>(column) - 1.0f;
  const float dz = static_cast<float>(row) - 5.0f;
  if (random.chance(0.75f * smooth_step(7.0f, 1.0f, dx * dx + dz * dz))) return BlockUse::towers;
  const float u = random.uniform();
  if (u < 0.09f) return BlockUse::park;
  if (u < 0.13f) return BlockUse::square;
  if (u < 0.17f) return BlockUse::towers;
  return BlockUse::houses;
}

Building make_house(std::uint64_t key, const Rect& base) {
  Random random(key);
  Building b{};
  b.key = key;
  b.base = base;
  b.floors = 3 + random.below(3);
  b.ground_height = random.uniform(3.9f, 4.6f);
  b.floor_height = random.uniform(3.0f, 3.4f);
  const float roof = random.uniform();
  b.roof = roof < 0.5f ? Roof::mansard : (roof < 0.8f ? Roof::hip : Roof::terrace);
  const float style = random.uniform();
  b.style = style < 0.55f ? Style::stucco : (style < 0.85f ? Style::stone : Style::brick);
  b.sides.fill(SideUse::court);
  return b;
}

/// Houses side by side from `start` to `end`; `place(from, to)` makes the rectangle of one.
template <typename Position>
void add_row(Block& block, std::uint64_t key, float start, float end, Side street, Side first,
             Side last, bool open_ends, const Position& position) {
  Random random(key);
  const float length = end - start;
  const int lots = std::max(1, static_cast<int>(std::floor(length / 15.5f + 0.5f)));
  std::vector<float> cuts(static_cast<std::size_t>(lots) + 1);
  for (int i = 0; i <= lots; ++i) {
    const float shift = i == 0 || i == lots ? 0.0f : random.uniform(-2.5f, 2.5f);
    cuts[static_cast<std::size_t>(i)] =
        start + length * static_cast<float>(i) / static_cast<float>(lots) + shift;
  }
  const std::size_t begin = block.buildings.size();
  for (std::size_t i = 0; i < static_cast<std::size_t>(lots); ++i) {
    Building b = make_house(child(key, i), position(cuts[i], cuts[i + 1]));
    b.sides[static_cast<std::size_t>(street)] = SideUse::street;
    const SideUse end_use = open_ends ? SideUse::street : SideUse::party;
    b.sides[static_cast<std::size_t>(first)] = i == 0 ? end_use : SideUse::party;
    b.sides[static_cast<std::size_t>(last)] =
        i + 1 == static_cast<std::size_t>(lots) ? end_use : SideUse::party;
    block.buildings.push_back(b);
  }
  for (std::size_t i = begin; i + 1 < block.buildings.size(); ++i) {
    Building& a = block.buildings[i];
    Building& b = block.buildings[i + 1];
    a.neighbour_eaves[static_cast<std::size_t>(last)] = b.eaves();
    b.neighbour_eaves[static_cast<std::size_t>(first)] = a.eaves();
  }
}

void plan_houses(Block& block) {
  const Rect& lot = block.lot;
  const float d = house_depth_m;
  add_row(block, child(block.key, 10), lot.min.y, lot.max.y, Side::west, Side::south, Side::north,
          true, [&](float a, float b) {
            return Rect{{lot.min.x, a}, {lot.min.x + d, b}};
          });
  add_row(block, child(block.key, 11), lot.min.y, lot.max.y, Side::east, Side::south, Side::north,
          true, [&](float a, float b) {
            return Rect{{lot.max.x - d, a}, {lot.max.x, b}};
          });
  add_row(block, child(block.key, 12), lot.min.x + d, lot.max.x - d, Side::south, Side::west,
          Side::east, false, [&](float a, float b) {
            return Rect{{a, lot.min.y}, {b, lot.min.y + d}};
          });
  add_row(block, child(block.key, 13), lot.min.x + d, lot.max.x - d, Side::north, Side::west,
          Side::east, false, [&](float a, float b) {
            return Rect{{a, lot.max.y - d}, {b, lot.max.y}};
          });
  Random random(child(block.key, 14));
  const glm::vec2 court = lot.size() - 2.0f * d - 10.0f;
  for (int i = 0; i < 5; ++i) {
    block.trees.push_back(
        {random.bits(), lot.min + d + 5.0f + court * glm::vec2{random.uniform(), random.uniform()},
         random.uniform(6.0f, 10.0f), random.uniform(2.2f, 3.2f)});
  }
}

void plan_towers(Block& block) {
  Random random(child(block.key, 20));
  const glm::vec2 size = block.lot.size();
  for (int i = 0; i < 2; ++i) {
    for (int j = 0; j < 2; ++j) {
      const float inset = random.uniform(2.0f, 6.0f);
      const glm::vec2 quarter = size * 0.5f;
      const glm::vec2 min = block.lot.min + quarter * glm::vec2(i, j) + inset;
      Building b{};
      b.key = random.bits();
      b.base = {min, min + quarter - 2.0f * inset};
      b.floors = 7 + random.below(16);
      b.ground_height = 5.5f;
      b.floor_height = 3.5f;
      b.roof = Roof::tower;
      b.style = random.chance(0.65f) ? Style::curtain : Style::stone;
      b.sides.fill(SideUse::street);
      block.buildings.push_back(b);
    }
  }
}

bool is_free(const Block& block, const glm::vec2& position, float distance) {
  return std::none_of(block.trees.begin(), block.trees.end(), [&](const Tree& tree) {
    const glm::vec2 d = tree.position - position;
    return glm::dot(d, d) < distance * distance;
  });
}

void plan_park(Block& block) {
  Random random(child(block.key, 30));
  const glm::vec2 size = block.lot.size();
  for (int attempt = 0; attempt < 90 && block.trees.size() < 34; ++attempt) {
    const glm::vec2 t{random.uniform(), random.uniform()};
    const glm::vec2 position = block.lot.min + 3.0f + (size - 6.0f) * t;
    const glm::vec2 from_middle = (t - 0.5f) * 2.0f;
    // A lawn with its pond in the middle, two paths that cross there, trees around.
    if (glm::dot(from_middle, from_middle) < 0.36f) continue;
    if (std::abs(from_middle.x) < 0.09f || std::abs(from_middle.y) < 0.09f) continue;
    if (!is_free(block, position, 5.5f)) continue;
    block.trees.push_back(
        {random.bits(), position, random.uniform(7.0f, 11.0f), random.uniform(2.5f, 3.9f)});
  }
}

void plan_square(Block& block) {
  // A hall with its bell tower, trees around.
  const glm::vec2 m = block.lot.middle();
  Building hall =
      make_house(child(block.key, 40), {m + glm::vec2(-10, -14), m + glm::vec2(10, 16)});
  hall.floors = 3;
  hall.style = Style::stone;
  hall.roof = Roof::hip;
  hall.sides.fill(SideUse::street);
  Building tower =
      make_house(child(block.key, 41), {m + glm::vec2(11, -14), m + glm::vec2(19, -6)});
  tower.floors = 12;
  tower.floor_height = 3.4f;
  tower.style = Style::stone;
  tower.roof = Roof::spire;
  tower.sides.fill(SideUse::street);
  block.buildings = {hall, tower};
  Random random(child(block.key, 42));
  for (int i = 0; i < 12; ++i) {
    const float along = (static_cast<float>(i % 6) + 0.5f) / 6.0f;
    const float x = block.lot.min.x + block.lot.size().x * along;
    const float z = i < 6 ? block.lot.min.y + 5.0f : block.lot.max.y - 5.0f;
    block.trees.push_back(
        {random.bits(), {x, z}, random.uniform(6.5f, 8.0f), random.uniform(2.2f, 2.8f)});
  }
}

/// Trees, lamps and cars along one street of this width; `place(along, across)` makes the point,
/// across counted from the middle of the road.
template <typename Position>
void plan_street(Block& block, std::uint64_t key, float width, float from, float to, bool along_x,
                 const Position& position) {
  Random random(key);
  const float pavement = pavement_width(width);
  const float kerb = width * 0.5f - pavement;
  const bool avenue = width > 20.0f;
  for (const float side : {-1.0f, 1.0f}) {
    const bool lined = avenue || random.chance(0.45f);
    int index = 0;
    for (float a = from + 5.0f; a < to - 4.0f; a += avenue ? 8.5f : 10.5f, ++index) {
      if (lined) {
        const float height = avenue ? random.uniform(7.0f, 8.6f) : random.uniform(5.5f, 7.0f);
        block.trees.push_back({random.bits(), position(a, side * (kerb + 1.2f)), height,
                               height * random.uniform(0.27f, 0.33f)});
      }
      if (index % 3 == 1) {
        const glm::vec2 foot = position(a + 4.2f, side * (kerb + 0.7f));
        const glm::vec2 road = position(a + 4.2f, 0.0f);
        block.lamps.push_back({foot, glm::normalize(road - foot)});
      }
    }
    for (float a = from + 4.0f; a < to - 6.0f; a += 5.6f) {  // parked
      if (random.chance(0.62f)) {
        block.cars.push_back({random.bits(),
                              position(a + random.uniform(-0.3f, 0.3f), side * (kerb - 1.15f)),
                              along_x, side > 0.0f});
      }
    }
    for (float a = from + 8.0f; a < to - 8.0f; a += 17.0f) {  // driving
      if (random.chance(avenue ? 0.45f : 0.25f)) {
        block.cars.push_back(
            {random.bits(), position(a + random.uniform(-4.0f, 4.0f), side * (kerb - 2.2f) * 0.5f),
             along_x, side > 0.0f});
      }
    }
  }
}

}  // namespace

float Building::roof_height() const {
  switch (roof) {
    case Roof::mansard:
      return 3.4f;
    case Roof::spire:
      return 1.7f * std::min(base.size().x, base.size().y);
    case Roof::hip:
      return 0.32f * std::min(base.size().x, base.size().y);
    default:
      return 1.0f;
  }
}

float detail_at(const glm::vec2& position) {
  const glm::vec2 nearest(0.0f, glm::clamp(position.y, -5.0f, 60.0f));
  const glm::vec2 d = (position - nearest) / 27.0f;
  const glm::vec2 from_start = (position - start_position - glm::vec2(0.0f, 17.0f)) / 13.0f;
  const float underfoot =
      1.6f / (1.0f + glm::dot(from_start, from_start) * glm::dot(from_start, from_start));
  return std::max(0.09f, 1.7f / (1.0f + glm::dot(d, d))) + underfoot;
}

float street_width_x(int column) { return column == 0 ? 28.0f : 17.0f; }
float street_width_z(int) { return 17.0f; }
float pavement_width(float street_width) { return street_width > 20.0f ? 6.0f : 3.6f; }

Block plan_block(std::uint64_t seed, int column, int row) {
  const auto cell = static_cast<std::uint64_t>(static_cast<std::uint32_t>(column)) << 32 |
                    static_cast<std::uint32_t>(row);
  Block block{};
  block.column = column;
  block.row = row;
  block.key = child(mix_bits(seed), cell);
  block.use = use_of(block.key, column, row);
  const float x0 = block_pitch_m * static_cast<float>(column);
  const float z0 = block_pitch_m * static_cast<float>(row);
  const float west = street_width_x(column), east = street_width_x(column + 1);
  const float south = street_width_z(row), north = street_width_z(row + 1);
  block.lot = {{x0 + west * 0.5f, z0 + south * 0.5f},
               {x0 + block_pitch_m - east * 0.5f, z0 + block_pitch_m - north * 0.5f}};
  switch (block.use) {
    case BlockUse::houses:
      plan_houses(block);
      break;
    case BlockUse::towers:
      plan_towers(block);
      break;
    case BlockUse::park:
      plan_park(block);
      break;
    case BlockUse::square:
      plan_square(block);
      break;
  }
  plan_street(block, child(block.key, 50), west, z0 + south * 0.5f,
              z0 + block_pitch_m - north * 0.5f, false,
              [&](float along, float across) { return glm::vec2(x0 + across, along); });
  plan_street(block, child(block.key, 51), south, x0 + west * 0.5f,
              x0 + block_pitch_m - east * 0.5f, true,
              [&](float along, float across) { return glm::vec2(along, z0 + across); });
  return block;
}

void add_shadows(const Block& block, Shadows& shadows) {
  for (const Building& b : block.buildings) {
    shadows.add_box(at(b.base.min.x, b.eaves(), b.base.min.y),
                    at(b.base.max.x, 0.0f, b.base.max.y));
    // The roof as a smaller box on top.
    const glm::vec2 inset = b.base.size() * 0.14f;
    const glm::vec2 min = b.base.min + inset, max = b.base.max - inset;
    shadows.add_box(at(min.x, b.eaves() + b.roof_height() * 0.7f, min.y),
                    at(max.x, b.eaves(), max.y));
  }
  for (const Tree& t : block.trees) {
    shadows.add_ball(at(t.position.x, t.height - t.crown * 1.1f, t.position.y), t.crown * 1.1f,
                     0.75f);
  }
}

}  // namespace catgs::synth

#include "tests/support/walker.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <queue>
#include <utility>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

namespace catgs::walk {
namespace {

constexpr float piece = 0.4f;  // cells; a body moves by at most this much at a time

glm::ivec2 cell_of(const glm::vec2& position) { return glm::ivec2(glm::floor(position)); }

/// Height of the ground (cells) at `position` for a walker whose ground was `height`: bilinear
/// between the middles of cells. Empty if no clear ground is within a step.
std::optional<float> ground_at(const WalkMap& map, const glm::vec2& position, float height) {
  const Position* here = map.clear_at(glm::ivec2(glm::floor(position)), height);
  if (!here) return std::nullopt;
  const glm::vec2 corner = glm::floor(position - 0.5f), share = position - 0.5f - corner;
  const auto at = [&](int x, int y) {
    const Position* found = map.clear_at(glm::ivec2(corner) + glm::ivec2(x, y), here->cells());
    return found ? found->cells() : here->cells();
  };
  return glm::mix(glm::mix(at(0, 0), at(1, 0), share.x), glm::mix(at(0, 1), at(1, 1), share.x),
                  share.y);
}

/// One piece of a move. Between two cells that touch in a corner alone, the body passes through one
/// of the two beside them.
std::optional<Stand> try_piece(const WalkMap& map, const Stand& from, const glm::vec2& way) {
  const Stand to{from.position + way, from.height};
  const glm::ivec2 here = cell_of(from.position), there = cell_of(to.position);
  const Position* ground = map.clear_at(here, from.height);
  if (!ground) return std::nullopt;
  if (here.x != there.x && here.y != there.y) {
    const Position* beside = map.clear_at({there.x, here.y}, ground->cells());
    if (!beside) beside = map.clear_at({here.x, there.y}, ground->cells());
    if (!beside) return std::nullopt;
    ground = beside;
  }
  const auto height = ground_at(map, to.position, ground->cells());
  if (!height) return std::nullopt;
  return Stand{to.position, *height};
}

}  // namespace

std::optional<Stand> stand_below(const WalkMap& map, const glm::vec3& position) {
  const glm::vec3 at = map.grid.from_world(position);
  const glm::ivec2 column = cell_of(glm::vec2(at));
  if (!map.holds(column)) return std::nullopt;
  std::optional<Stand> stand;
  for (const Position& ground : map.at(column))
    if (ground.kind == Kind::clear && ground.cells() <= at.z + Person::in_cells(map.person.step))
      stand = Stand{glm::vec2(at), ground.cells()};
  return stand;
}

glm::vec3 eyes_of(const WalkMap& map, const Stand& stand) {
  return map.grid.to_world(glm::vec3(stand.position, stand.height + cells_per_eye_height));
}

Stand move(const WalkMap& map, const Stand& from, const glm::vec2& way) {
  constexpr float pi = 3.14159265f;
  constexpr std::array<float, 7> aside = {0,       pi / 8,     -pi / 8,    pi / 4,
                                          -pi / 4, 3 * pi / 8, -3 * pi / 8};
  const int pieces = static_cast<int>(std::ceil(std::min(glm::length(way) / piece, 1e4f)));
  const glm::vec2 part = way / static_cast<float>(std::max(pieces, 1));
  Stand at = from;
  for (int k = 0; k < pieces; ++k) {
    const auto turned = std::ranges::find_if(aside, [&](float angle) {
      const float c = std::cos(angle), s = std::sin(angle);
      const glm::vec2 along = c * glm::vec2(c * part.x - s * part.y, s * part.x + c * part.y);
      const auto next = try_piece(map, at, along);
      if (next) at = *next;
      return next.has_value();
    });
    if (turned == aside.end()) break;
  }
  return at;
}

bool straight(const WalkMap& map, const Stand& from, const Stand& to) {
  const glm::vec2 way = to.position - from.position;
  const int pieces = static_cast<int>(std::ceil(glm::length(way) / piece));
  Stand at = from;
  for (int k = 0; k < pieces; ++k) {
    const auto next = try_piece(map, at, way / static_cast<float>(pieces));
    if (!next) return false;
    at = *next;
  }
  return std::abs(at.height - to.height) <= Person::in_cells(map.person.step);
}

namespace {

struct Node {
  float cost = std::numeric_limits<float>::max();  // from the start, cells
  std::uint32_t before = 0;                        // the place that it is reached from
  std::uint32_t column = 0;                        // row by row
};

/// Leaves out what a straight line passes.
std::vector<Stand> with_straight_pieces(const WalkMap& map, const std::vector<Stand>& path) {
  constexpr std::size_t most = 256;  // places that a line is tried over
  std::vector<Stand> turns = {path.front()};
  for (std::size_t at = 0; at + 1 < path.size();) {
    std::size_t next = at + 1;
    for (std::size_t far = std::min(path.size() - 1, at + most); far > next; far = (far + at) / 2)
      if (straight(map, path[at], path[far])) next = far;
    turns.push_back(path[next]);
    at = next;
  }
  return turns;
}

}  // namespace

std::vector<Stand> find_path(const WalkMap& map, const Stand& from, const Stand& to) {
  const Position* begin = map.clear_at(cell_of(from.position), from.height);
  const Position* end = map.clear_at(cell_of(to.position), to.height);
  if (!begin || !end) return {};
  const auto index = [&](const Position* p) {
    return static_cast<std::uint32_t>(p - map.positions.data());
  };
  const auto cell = [&](std::uint32_t column) {
    return glm::ivec2(static_cast<int>(column) % map.size.x, static_cast<int>(column) / map.size.x);
  };
  const auto column = [&](const glm::ivec2& c) {
    return static_cast<std::uint32_t>(c.y * map.size.x + c.x);
  };
  std::vector<Node> nodes(map.positions.size());
  using Entry = std::pair<float, std::uint32_t>;  // cost and the least that is left; place
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> open;
  const glm::ivec2 goal = cell_of(to.position);
  const auto left = [&](const glm::ivec2& c) {
    const glm::ivec2 d = glm::abs(goal - c);
    return static_cast<float>(std::max(d.x, d.y)) +
           0.41421356f * static_cast<float>(std::min(d.x, d.y));
  };
  const auto reach = [&](std::uint32_t position, const glm::ivec2& c, float cost,
                         std::uint32_t before) {
    if (cost >= nodes[position].cost) return;
    nodes[position] = {cost, before, column(c)};
    open.emplace(cost + left(c), position);
  };
  reach(index(begin), cell_of(from.position), 0.0f, index(begin));
  while (!open.empty() && open.top().second != index(end)) {
    const auto [estimate, position] = open.top();
    open.pop();
    const glm::ivec2 c = cell(nodes[position].column);
    if (estimate > nodes[position].cost + left(c) + 1e-3f * (1.0f + estimate)) continue;
    const float height = map.positions[position].cells();
    for (int y = -1; y <= 1; ++y)
      for (int x = -1; x <= 1; ++x) {
        if (x == 0 && y == 0) continue;
        const Position* next = map.clear_at(c + glm::ivec2(x, y), height);
        const bool diagonal = x != 0 && y != 0;
        if (!next || (diagonal && (!map.clear_at(c + glm::ivec2(x, 0), height) ||
                                   !map.clear_at(c + glm::ivec2(0, y), height))))
          continue;
        reach(index(next), c + glm::ivec2(x, y),
              nodes[position].cost + (diagonal ? 1.41421356f : 1.0f), position);
      }
  }
  if (open.empty()) return {};
  if (index(begin) == index(end)) return {from, to};
  std::vector<Stand> path = {to};
  for (std::uint32_t position = index(end); position != index(begin);) {
    position = nodes[position].before;
    path.push_back(
        {glm::vec2(cell(nodes[position].column)) + 0.5f, map.positions[position].cells()});
  }
  path.back() = from;
  std::ranges::reverse(path);
  return with_straight_pieces(map, path);
}

}  // namespace catgs::walk

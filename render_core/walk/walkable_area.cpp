#include "render_core/walk/walkable_area.h"

#include <algorithm>
#include <cmath>
#include <string_view>
#include <tuple>
#include <utility>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "render_core/base/error.h"
#include "render_core/walk/shiny_floors.h"
#include "render_core/walk/storeys.h"
#include "render_core/walk/surfaces.h"

namespace catgs::walk {
namespace {

constexpr int near_steps = 3;      // from clear ground to the last place that is kept
constexpr int obstacle_cells = 3;  // as far as obstacles are drawn

/// Turns of long loops of one thread. `progress` is called at some of them.
class Turns {
 public:
  explicit Turns(const std::function<void()>& progress) : progress_(progress) {}
  void next() {
    constexpr std::uint32_t at_a_time = 16384;
    if (++count_ % at_a_time == 0) progress_();
  }

 private:
  const std::function<void()>& progress_;
  std::uint32_t count_ = 0;
};

struct Component {
  std::uint32_t seed = Surfaces::none;  // the surface that is nearest to the start, below it
  float distance = std::numeric_limits<float>::max();
  std::size_t size = 0;
};

/// The surfaces of `among` that are connected to `seed`; takes them out of `among`.
std::vector<std::uint32_t> flood(const Surfaces& surfaces, std::uint32_t seed,
                                 std::vector<char>& among, Turns& turns) {
  std::vector<std::uint32_t> reached = {seed};
  among[seed] = 0;
  for (std::size_t k = 0; k < reached.size(); ++k) {
    turns.next();
    for (int d = 0; d < 4; ++d) {
      const std::uint32_t next = surfaces.next(reached[k], d);
      if (next == Surfaces::none || !among[next]) continue;
      among[next] = 0;
      reached.push_back(next);
    }
  }
  return reached;
}

glm::vec3 middle_of(const Surfaces& surfaces, std::uint32_t i) {
  return {glm::vec2(surfaces.column_of(i)) + 0.5f, surfaces.height(i)};
}

/// The nearest component below `start` that is not small; its seed is `none` where there is none.
Component component_below(const Surfaces& surfaces, std::vector<char> clear, const glm::vec3& start,
                          Turns& turns) {
  constexpr std::size_t small = 20;    // times smaller than the largest
  constexpr std::size_t enough = 400;  // cells: a terrace, under which a lawn lies
  const float below = Person::in_cells(1.5f);
  std::vector<Component> components;
  for (std::uint32_t i = 0; i < surfaces.count(); ++i) {
    if (!clear[i]) continue;
    Component component;
    const std::vector<std::uint32_t> members = flood(surfaces, i, clear, turns);
    component.size = members.size();
    for (const std::uint32_t k : members) {
      const glm::vec3 position = middle_of(surfaces, k);
      const float distance = glm::distance(position, start);
      if (position.z <= start.z && distance < component.distance) {
        component.seed = k;
        component.distance = distance;
      }
    }
    if (component.seed != Surfaces::none) components.push_back(component);
  }
  std::size_t largest = 0;
  for (const Component& c : components) largest = std::max(largest, c.size);
  Component best;
  for (const Component& c : components)
    if ((small * c.size >= largest || (c.size >= enough && c.distance <= below)) &&
        c.distance < best.distance)
      best = c;
  return best;
}

/// A place of a map before the columns are sorted.
struct Found {
  std::uint32_t column;  // row by row of the surfaces' extent
  float height;          // cells
  Kind kind;
};

class Collector {
 public:
  Collector(const Surfaces& surfaces, const Person& person, Turns& turns)
      : surfaces_(surfaces),
        turns_(turns),
        person_(person),
        size_(surfaces.extent().max - surfaces.extent().min),
        kept_(surfaces.count()) {}

  /// Takes the clear ground that is connected to `seed`, and what is near to it.
  void take_area(std::uint32_t seed, std::vector<char> clear) {
    std::vector<std::uint32_t> edge = flood(surfaces_, seed, clear, turns_);
    for (const std::uint32_t i : edge) take(i, Kind::clear);
    for (int step = 0; step < near_steps; ++step) {
      std::vector<std::uint32_t> beyond;
      for (const std::uint32_t i : edge)
        for (int d = 0; d < 4; ++d) {
          const std::uint32_t next = surfaces_.next(i, d);
          if (next == Surfaces::none || kept_[next]) continue;
          take(next, Kind::near);
          beyond.push_back(next);
        }
      edge = std::move(beyond);
    }
  }

  /// Takes the obstacles beside the ground.
  void take_obstacles() {
    std::vector<Found> edge;
    for (std::uint32_t i = 0; i < kept_.size(); ++i)
      for (int d = 0; kept_[i] && d < 4; ++d)
        if (const std::uint32_t next = surfaces_.next(i, d); next == Surfaces::none || !kept_[next])
          add_obstacle(surfaces_.column_of(i) + Surfaces::directions[d], surfaces_.height(i), edge);
    for (int step = 1;; ++step) {
      edge = without_doubles(std::move(edge));
      found_.insert(found_.end(), edge.begin(), edge.end());
      if (step == obstacle_cells) break;
      std::vector<Found> beyond;
      for (const Found& from : edge)
        for (const glm::ivec2& direction : Surfaces::directions)
          add_obstacle(cell_of(from.column) + direction, from.height, beyond);
      edge = std::move(beyond);
    }
    found_ = without_doubles(std::move(found_));
  }

  /// The map of all that was taken, without its start and its storeys.
  [[nodiscard]] WalkMap map(const Grid& grid) const {
    glm::ivec2 low(grid_side), high(0);
    for (const Found& f : found_) {
      low = glm::min(low, cell_of(f.column));
      high = glm::max(high, cell_of(f.column) + 1);
    }
    WalkMap map{grid, person_, {}, high - low, {}, {}, {}};
    map.grid.origin = grid.to_world(glm::vec3(glm::vec2(low), 0.0f));
    map.first.resize(static_cast<std::size_t>(map.size.x) * static_cast<std::size_t>(map.size.y) +
                     1);
    for (const Found& f : found_) {
      const glm::ivec2 at = cell_of(f.column) - low;
      ++map.first[static_cast<std::size_t>(at.y) * static_cast<std::size_t>(map.size.x) +
                  static_cast<std::size_t>(at.x) + 1];
      const float height = std::clamp(f.height, 0.0f, grid_levels - 1.0f);
      map.positions.push_back(
          {static_cast<std::uint16_t>(std::lround(height * Position::per_cell)), f.kind});
    }
    for (std::size_t c = 1; c < map.first.size(); ++c) map.first[c] += map.first[c - 1];
    return map;
  }

 private:
  [[nodiscard]] glm::ivec2 cell_of(std::uint32_t column) const {
    const int c = static_cast<int>(column);
    return surfaces_.extent().min + glm::ivec2(c % size_.x, c / size_.x);
  }

  void take(std::uint32_t i, Kind kind) {
    const glm::ivec2 at = surfaces_.column_of(i) - surfaces_.extent().min;
    kept_[i] = 1;
    found_.push_back(
        {static_cast<std::uint32_t>(at.y * size_.x + at.x), surfaces_.height(i), kind});
  }

  /// Adds the obstacle that blocks a body on ground of this height.
  void add_obstacle(const glm::ivec2& column, float height, std::vector<Found>& to) const {
    turns_.next();
    const glm::ivec2 at = column - surfaces_.extent().min;
    const std::span<const Run> runs = surfaces_.runs_at(column);
    const auto between = [&](float low, float high) {
      return std::ranges::any_of(runs, [&](const Run& run) {
        return run.top > height + Person::in_cells(low) &&
               run.low < height + Person::in_cells(high);
      });
    };
    if (!between(person_.step, person_.height)) return;
    to.push_back({static_cast<std::uint32_t>(at.y * size_.x + at.x), height,
                  between(person_.chest, 1.0f) ? Kind::obstacle : Kind::low});
  }

  /// Sorted by column and height. Of those within a step, ground stays, or else the higher
  /// obstacle.
  [[nodiscard]] std::vector<Found> without_doubles(std::vector<Found> positions) const {
    std::ranges::sort(positions, {}, [this](const Found& f) {
      turns_.next();
      return std::tuple(f.column, f.height, f.kind);
    });
    const auto rank = [](const Found& f) {
      return f.kind == Kind::low ? 1 : f.kind == Kind::obstacle ? 2 : 3;
    };
    std::vector<Found> single;
    for (const Found& f : positions) {
      const bool apart = single.empty() || single.back().column != f.column ||
                         f.height - single.back().height > Person::in_cells(person_.step);
      if (apart)
        single.push_back(f);
      else if (rank(f) > rank(single.back()))
        single.back() = f;
    }
    return single;
  }

  const Surfaces& surfaces_;
  Turns& turns_;
  Person person_;
  glm::ivec2 size_;
  std::vector<char> kept_;
  std::vector<Found> found_;
};

/// The surfaces of an occupancy, and the clear area below the start.
struct Ground {
  Ground(const Occupancy& occupancy, const Person& person, const glm::vec3& start, ThreadPool& pool,
         const std::function<void()>& progress, Turns& turns)
      : surfaces(occupancy, person, pool, progress),
        clear(surfaces.with_room(pool)),
        below(component_below(surfaces, clear, occupancy.grid().from_world(start), turns)) {}

  [[nodiscard]] std::vector<std::uint32_t> reached(Turns& turns) const {
    std::vector<char> among = clear;
    return flood(surfaces, below.seed, among, turns);
  }

  Surfaces surfaces;
  std::vector<char> clear;
  Component below;
};

}  // namespace

WalkMap find_walkable_area(Occupancy& occupancy, const Person& person, const glm::vec3& start,
                           std::string_view name, ThreadPool& pool,
                           const std::function<void()>& progress) {
  Turns turns(progress);
  const auto search = [&] { return Ground(occupancy, person, start, pool, progress, turns); };
  Ground ground = search();
  if (ground.below.seed == Surfaces::none)
    throw InputError(name, "", "nobody can stand below its start",
                     "--eye-height has the scene's units; a sidecar can name another start or up");
  if (add_shiny_floors(occupancy, ground.surfaces, person, ground.reached(turns),
                       [&] { turns.next(); }) > 0)
    ground = search();
  const auto& [surfaces, clear, below] = ground;
  Collector collector(surfaces, person, turns);
  collector.take_area(below.seed, clear);
  collector.take_obstacles();
  WalkMap map = collector.map(occupancy.grid());
  const glm::vec3 seed = occupancy.grid().to_world(middle_of(surfaces, below.seed));
  const glm::vec3 at = map.grid.from_world(seed);
  map.start = {glm::vec2(at), at.z};
  map.storeys = find_storeys(map);
  return map;
}

}  // namespace catgs::walk

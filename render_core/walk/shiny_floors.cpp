#include "render_core/walk/shiny_floors.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include <glm/common.hpp>

namespace catgs::walk {
namespace {

constexpr float same_level = 1.5f;  // cells

/// The heights at which much of the floor that is reached lies.
std::vector<float> levels_of(const Surfaces& surfaces, std::span<const std::uint32_t> reached) {
  constexpr std::size_t apart = 4, most = 8;
  constexpr double much = 0.1;
  std::array<std::size_t, grid_levels> area{};
  std::array<double, grid_levels> height{};
  for (const std::uint32_t i : reached) {
    const auto bin = static_cast<std::size_t>(
        std::clamp(surfaces.height(i), 0.0f, static_cast<float>(grid_levels - 1)));
    ++area[bin];
    height[bin] += static_cast<double>(surfaces.height(i));
  }
  std::vector<float> levels;
  while (levels.size() < most) {
    const auto peak = static_cast<std::size_t>(std::ranges::max_element(area) - area.begin());
    const std::size_t low = peak > 0 ? peak - 1 : 0, high = std::min(area.size(), peak + 2);
    std::size_t count = 0;
    double sum = 0.0;
    for (std::size_t k = low; k < high; ++k) {
      count += area[k];
      sum += height[k];
    }
    if (count == 0 || static_cast<double>(count) < much * static_cast<double>(reached.size()))
      break;
    levels.push_back(static_cast<float>(sum / static_cast<double>(count)));
    for (std::size_t k = peak > apart ? peak - apart : 0;
         k < std::min(area.size(), peak + apart + 1); ++k)
      area[k] = 0;
  }
  return levels;
}

enum class State : char { free, ground, blocked };

/// The columns around a level. Counts are summed from the south-west, for windows.
class Level {
 public:
  Level(const Surfaces& surfaces, const Person& person, const std::vector<char>& reached,
        float height, const std::function<void()>& turn)
      : low_(surfaces.extent().min),
        size_(surfaces.extent().max - surfaces.extent().min),
        free_(static_cast<std::size_t>(size_.x) * static_cast<std::size_t>(size_.y)),
        sums_(static_cast<std::size_t>(size_.x + 1) * static_cast<std::size_t>(size_.y + 1)) {
    const float step = Person::in_cells(person.step), body = Person::in_cells(person.height);
    for (int y = 0; y < size_.y; ++y)
      for (int x = 0; x < size_.x; ++x) {
        turn();
        Count here;
        bool ground = false, blocked = false;
        const std::size_t first = surfaces.first_at(low_ + glm::ivec2(x, y));
        const auto runs = surfaces.runs_at(low_ + glm::ivec2(x, y));
        for (std::size_t k = 0; k < runs.size(); ++k) {
          if (runs[k].low >= height + body) {
            here.above = 1;
          } else if (runs[k].top < height - step) {
            here.below = 1;
            here.reached = reached[first + k] != 0 ? 1 : here.reached;
          } else if (std::abs(runs[k].top - height) <= same_level) {
            ground = true;
          } else {
            blocked = true;
          }
        }
        free_[index({x, y})] = blocked ? State::blocked : ground ? State::ground : State::free;
        sums_[sum_index({x + 1, y + 1})] = here + sums_[sum_index({x, y + 1})] +
                                           sums_[sum_index({x + 1, y})] - sums_[sum_index({x, y})];
      }
  }

  [[nodiscard]] bool holds(const glm::ivec2& at) const {
    return at.x >= 0 && at.y >= 0 && at.x < size_.x && at.y < size_.y;
  }
  [[nodiscard]] bool is_ground(const glm::ivec2& at) const {
    return free_[index(at)] == State::ground;
  }
  [[nodiscard]] std::size_t columns() const { return free_.size(); }
  [[nodiscard]] const glm::ivec2& low() const { return low_; }
  [[nodiscard]] std::size_t index(const glm::ivec2& at) const {
    return static_cast<std::size_t>(at.y) * static_cast<std::size_t>(size_.x) +
           static_cast<std::size_t>(at.x);
  }
  /// Whether floor may be missing there, by what is around.
  [[nodiscard]] bool is_gap(const glm::ivec2& at) const {
    constexpr int around = 6;              // cells
    constexpr int ceiling = 6, third = 3;  // a sixth and a third of the columns around
    if (free_[index(at)] != State::free) return false;
    const glm::ivec2 from = glm::max(at - around, glm::ivec2(0));
    const glm::ivec2 to = glm::min(at + around + 1, size_);
    const int cells = (to.x - from.x) * (to.y - from.y);
    const Count in = sums_[sum_index(to)] - sums_[sum_index({from.x, to.y})] -
                     sums_[sum_index({to.x, from.y})] + sums_[sum_index(from)];
    return ceiling * in.above > cells && third * in.below > cells && third * in.reached < cells;
  }

 private:
  struct Count {
    int above = 0, below = 0, reached = 0;
    Count operator+(const Count& o) const {
      return {above + o.above, below + o.below, reached + o.reached};
    }
    Count operator-(const Count& o) const {
      return {above - o.above, below - o.below, reached - o.reached};
    }
  };
  [[nodiscard]] std::size_t sum_index(const glm::ivec2& at) const {
    return static_cast<std::size_t>(at.y) * static_cast<std::size_t>(size_.x + 1) +
           static_cast<std::size_t>(at.x);
  }

  glm::ivec2 low_, size_;
  std::vector<State> free_;
  std::vector<Count> sums_;
};

}  // namespace

std::size_t add_shiny_floors(Occupancy& occupancy, const Surfaces& surfaces, const Person& person,
                             std::span<const std::uint32_t> reached,
                             const std::function<void()>& turn) {
  std::vector<char> is_reached(surfaces.count());
  for (const std::uint32_t i : reached) is_reached[i] = 1;
  std::size_t added = 0;
  for (const float height : levels_of(surfaces, reached)) {
    const Level level(surfaces, person, is_reached, height, turn);
    std::vector<glm::ivec2> edge;
    for (const std::uint32_t i : reached)
      if (std::abs(surfaces.height(i) - height) <= same_level)
        edge.push_back(surfaces.column_of(i) - level.low());
    std::vector<glm::ivec2> gaps;
    std::vector<char> taken(level.columns());
    while (!edge.empty()) {
      turn();
      const glm::ivec2 from = edge.back();
      edge.pop_back();
      for (const glm::ivec2& direction : Surfaces::directions) {
        const glm::ivec2 at = from + direction;
        if (!level.holds(at) || taken[level.index(at)] != 0) continue;
        const bool is_gap = level.is_gap(at);
        if (!is_gap && !level.is_ground(at)) continue;
        taken[level.index(at)] = 1;
        edge.push_back(at);
        if (is_gap) gaps.push_back(at);
      }
    }
    for (const glm::ivec2& at : gaps) occupancy.add_solid(level.low() + at, height);
    added += gaps.size();
  }
  return added;
}

}  // namespace catgs::walk

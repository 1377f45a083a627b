#include "render_core/walk/walk_map.h"

#include <cmath>

#include <glm/common.hpp>

namespace catgs::walk {

const Place* WalkMap::clear_at(const glm::ivec2& column, float height) const {
  if (!holds(column)) return nullptr;
  for (const Place& place : at(column))
    if (place.kind == Kind::clear &&
        std::abs(place.cells() - height) <= Person::in_cells(person.step))
      return &place;
  return nullptr;
}

std::size_t WalkMap::storey_at(float height) const {
  std::size_t storey = 0;
  while (storey + 1 < storeys.size() && height >= storeys[storey + 1].low) ++storey;
  return storey;
}

std::optional<float> ground_at(const WalkMap& map, const glm::vec2& place, float height) {
  const Place* here = map.clear_at(glm::ivec2(glm::floor(place)), height);
  if (!here) return std::nullopt;
  const glm::vec2 corner = glm::floor(place - 0.5f), share = place - 0.5f - corner;
  const auto at = [&](int x, int y) {
    const Place* found = map.clear_at(glm::ivec2(corner) + glm::ivec2(x, y), here->cells());
    return found ? found->cells() : here->cells();
  };
  return glm::mix(glm::mix(at(0, 0), at(1, 0), share.x), glm::mix(at(0, 1), at(1, 1), share.x),
                  share.y);
}

}  // namespace catgs::walk

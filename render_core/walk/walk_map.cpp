#include "render_core/walk/walk_map.h"

#include <cmath>

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

}  // namespace catgs::walk

#include "render_core/walk/walk_map.h"

#include <cmath>

namespace catgs::walk {

const Position* WalkMap::clear_at(const glm::ivec2& column, float height) const {
  if (!holds(column)) return nullptr;
  for (const Position& position : at(column))
    if (position.kind == Kind::clear &&
        std::abs(position.cells() - height) <= Person::in_cells(person.step))
      return &position;
  return nullptr;
}

std::size_t WalkMap::storey_at(float height) const {
  std::size_t storey = 0;
  while (storey + 1 < storeys.size() && height >= storeys[storey + 1].low) ++storey;
  return storey;
}

}  // namespace catgs::walk

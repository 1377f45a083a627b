#pragma once

#include <cstdint>
#include <functional>

#include "render_core/walk/storeys.h"
#include "render_core/walk/walk_map.h"

namespace catgs::test {

/// A map of one layer, made by hand: `kind` of each column, all at the same height. Empty columns
/// are those of Kind{9}.
inline walk::WalkMap hand_made_map(const glm::ivec2& size,
                                   const std::function<walk::Kind(int x, int y)>& kind) {
  walk::WalkMap map;
  map.grid.cell = 0.1f;
  map.size = size;
  map.first.push_back(0);
  for (int y = 0; y < size.y; ++y)
    for (int x = 0; x < size.x; ++x) {
      if (kind(x, y) <= walk::Kind::obstacle) map.positions.push_back({160, kind(x, y)});
      map.first.push_back(static_cast<std::uint32_t>(map.positions.size()));
    }
  map.start = {glm::vec2(0.5f), 10.0f};
  map.storeys = walk::find_storeys(map);
  return map;
}

}  // namespace catgs::test

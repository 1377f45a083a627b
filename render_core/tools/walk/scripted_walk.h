#pragma once

#include <cstdint>
#include <vector>

#include "render_core/base/thread_pool.h"
#include "render_core/tools/walk/sight_line.h"
#include "render_core/walk/walker.h"

namespace catgs {

/// Where a scripted walker stood, 30 times a second.
struct ScriptedWalk {
  std::vector<walk::Stand> stands;
  int goals = 0;    // places that the walker set out for
  int reached = 0;  // of those
};

/// Walks at 0.9 eye heights a second. The walker takes turns: a way to a random place within fifty
/// eye heights, then three seconds straight on in a random direction, whatever is in the way. The
/// same for the same map and seed.
ScriptedWalk scripted_walk(const walk::WalkMap& map, double seconds, std::uint64_t seed);

/// What the Gaussians say about a walk.
struct WalkCheck {
  float length = 0.0f, climbed = 0.0f;  // cells; all rises
  float largest_drop = 0.0f;            // cells, between two samples
  std::size_t pieces = 0;               // of three cells each, one beginning at each cell
  std::size_t blocked = 0;              // pieces at chest height that stop half of the light
  float least_light = 1.0f;             // that passes through a piece
  std::size_t unsupported = 0;  // where less than a tenth is stopped from the chest to the ground
  float most_light_below = 0.0f;
  std::vector<glm::vec3> faults;  // world places of the first blocked and unsupported ones

  /// No wall was passed, and the walker never fell.
  [[nodiscard]] bool passed(const walk::Person& person) const {
    return blocked == 0 && unsupported == 0 && largest_drop <= walk::Person::in_cells(person.step);
  }
};

WalkCheck check_walk(const walk::WalkMap& map, const ScriptedWalk& walk, const SightLines& lines,
                     ThreadPool& pool);

}  // namespace catgs

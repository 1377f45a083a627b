#pragma once

namespace catgs {

/// Where a camera may be that orbits around a scene, as a file says it.
struct OrbitLimits {
  float min_elevation = 0.0f, max_elevation = 0.0f;  // radians above the focus, seen from it
  float min_radius = 0.0f;                           // world units, to the focus
};

}  // namespace catgs

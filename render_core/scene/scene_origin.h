#pragma once

#include <cstddef>
#include <span>

#include <glm/common.hpp>
#include <glm/vec3.hpp>
#include <glm/vector_relational.hpp>

#include "render_core/scene/gaussian_cloud.h"

namespace catgs {

// A scene far from 0, as surveys have it, is kept about an origin of its own: GaussianCloud's 0
// lies there in the file's coordinates (world axes and units). Files beside a scene count from the
// file's 0. Readers subtract the origin in double precision, before a place becomes a float.

/// The origin for places around `middle`: 0 where floats hold them, else whole units, which read
/// well. From 1,024 units on, floats lie 1.2e-4 apart. Half a step on each of three axes moves a
/// place by up to 1.06e-4.
inline glm::dvec3 origin_near(const glm::dvec3& middle) {
  constexpr double held_by_floats = 1024.0;
  const bool near = glm::all(glm::lessThan(glm::abs(middle), glm::dvec3(held_by_floats)));
  return near ? glm::dvec3(0.0) : glm::round(middle);
}

/// The most places that decide an origin.
inline constexpr std::size_t most_origin_positions = std::size_t{1} << 16;

/// The origin of a scene with these places, which may be rounded to floats already. An even sample
/// decides. It is near the medians, so neither outliers nor a smaller part of the scene move it.
glm::dvec3 find_origin(std::span<const glm::vec3> positions);

/// Moves the 0 of a cloud by `by`. Floats near `by` lose nothing.
void move_origin(GaussianCloud& cloud, const glm::dvec3& by);

}  // namespace catgs

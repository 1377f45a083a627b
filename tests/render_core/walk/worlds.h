#pragma once

#include <cmath>

#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

#include "render_core/base/portable.h"
#include "render_core/base/thread_pool.h"
#include "render_core/scene/gaussian_cloud.h"
#include "render_core/walk/occupancy.h"
#include "render_core/walk/walk_map.h"
#include "render_core/walk/walkable_area.h"

namespace catgs::test {

inline constexpr float eye_m = 1.6f;  // so that a cell has 0.1 m

/// Adds an opaque plate of small discs: a parallelogram in metres.
inline void add_plate(GaussianCloud& cloud, const glm::vec3& corner, const glm::vec3& u,
                      const glm::vec3& v) {
  constexpr float apart = 0.05f, sigma = 0.04f;
  const glm::vec3 normal = glm::normalize(glm::cross(u, v)), along = glm::normalize(u);
  const glm::quat rotation = glm::quat_cast(glm::mat3(along, glm::cross(normal, along), normal));
  const int columns = static_cast<int>(std::ceil(glm::length(u) / apart));
  const int rows = static_cast<int>(std::ceil(glm::length(v) / apart));
  for (int y = 0; y < rows; ++y)
    for (int x = 0; x < columns; ++x) {
      const float a = (static_cast<float>(x) + 0.5f) / static_cast<float>(columns);
      const float b = (static_cast<float>(y) + 0.5f) / static_cast<float>(rows);
      cloud.mean.push_back(corner + a * u + b * v);
      cloud.rotation.push_back(rotation);
      cloud.scale.emplace_back(sigma, sigma, 0.1f * sigma);
      cloud.opacity.push_back(0.9f);
      cloud.sh.emplace_back(0.0f);
    }
}

/// A room of 8 x 6 m with z up and its floor at z = 0. A wall at x = 4 has a gap from y = 2.5 of
/// the given width, up to the ceiling at 2.6 m. A table of 1 x 1 m stands at (1, 4).
inline GaussianCloud room(float gap_m) {
  GaussianCloud cloud;
  const float top = 2.6f;
  add_plate(cloud, {0, 0, 0}, {8, 0, 0}, {0, 6, 0});
  add_plate(cloud, {0, 0, top}, {8, 0, 0}, {0, 6, 0});
  for (const float y : {0.0f, 6.0f}) add_plate(cloud, {0, y, 0}, {8, 0, 0}, {0, 0, top});
  for (const float x : {0.0f, 8.0f}) add_plate(cloud, {x, 0, 0}, {0, 6, 0}, {0, 0, top});
  add_plate(cloud, {4, 0, 0}, {0, 2.5f, 0}, {0, 0, top});
  add_plate(cloud, {4, 2.5f + gap_m, 0}, {0, 3.5f - gap_m, 0}, {0, 0, top});
  add_plate(cloud, {1, 4, 0.75f}, {1, 0, 0}, {0, 1, 0});
  return cloud;
}

/// Stairs of 16 steps of 0.17 x 0.28 m, 1.5 m wide, from (2, 0) on the ground in direction +x to an
/// upper floor at z = 2.72 that goes from x = 6.48 to 10.
inline GaussianCloud stairs() {
  GaussianCloud cloud;
  add_plate(cloud, {-2, 0, 0}, {12, 0, 0}, {0, 6, 0});
  for (int k = 0; k < 16; ++k) {
    const float x = 2.0f + 0.28f * static_cast<float>(k), z = 0.17f * static_cast<float>(k);
    add_plate(cloud, {x, 0, z}, {0, 1.5f, 0}, {0, 0, 0.17f});
    add_plate(cloud, {x, 0, z + 0.17f}, {0.28f, 0, 0}, {0, 1.5f, 0});
  }
  add_plate(cloud, {6.48f, 0, 2.72f}, {3.52f, 0, 0}, {0, 6, 0});
  return cloud;
}

/// A storey on stilts, 8 x 6 m, with its floor at z = 2.9 and a room of 2.6 m. A terrace of 2.5 m
/// with a railing lies before its glass front at x = 0, below eaves. A lawn of 40 x 40 m is all
/// around.
inline GaussianCloud villa() {
  GaussianCloud cloud;
  const float floor = 2.9f, top = 5.5f;
  add_plate(cloud, {-20, -17, 0}, {40, 0, 0}, {0, 40, 0});
  add_plate(cloud, {-2.5f, 0, floor}, {10.5f, 0, 0}, {0, 6, 0});
  add_plate(cloud, {-2.5f, 0, top}, {10.5f, 0, 0}, {0, 6, 0});
  for (const float y : {0.0f, 6.0f}) add_plate(cloud, {0, y, floor}, {8, 0, 0}, {0, 0, 2.6f});
  add_plate(cloud, {8, 0, floor}, {0, 6, 0}, {0, 0, 2.6f});
  add_plate(cloud, {0, 0, floor}, {0, 2, 0}, {0, 0, 2.6f});
  add_plate(cloud, {0, 3, floor}, {0, 3, 0}, {0, 0, 2.6f});
  add_plate(cloud, {-2.5f, 0, floor}, {0, 6, 0}, {0, 0, 1});
  for (const float y : {0.0f, 6.0f}) add_plate(cloud, {-2.5f, y, floor}, {2.5f, 0, 0}, {0, 0, 1});
  return cloud;
}
inline constexpr glm::vec3 terrace_start(-2.1f, 3, 4.5f);

/// A room as room() without its wall and its table, whose floor shines from x = 3 on: light comes
/// from what is mirrored, faint and deep below.
inline GaussianCloud shiny_room() {
  GaussianCloud cloud;
  const float top = 2.6f;
  add_plate(cloud, {0, 0, 0}, {3, 0, 0}, {0, 6, 0});
  add_plate(cloud, {0, 0, top}, {8, 0, 0}, {0, 6, 0});
  for (const float y : {0.0f, 6.0f}) add_plate(cloud, {0, y, 0}, {8, 0, 0}, {0, 0, top});
  for (const float x : {0.0f, 8.0f}) add_plate(cloud, {x, 0, 0}, {0, 6, 0}, {0, 0, top});
  SplitMix64 random(3);
  const auto share = [&] { return static_cast<float>(random.next() >> 40) * 0x1p-24f; };
  for (int k = 0; k < 20000; ++k) {
    const glm::vec3 at(3.0f + 5.0f * share(), 6.0f * share(), -1.0f - 3.0f * share());
    cloud.mean.push_back(at);
    cloud.rotation.emplace_back(1.0f, 0.0f, 0.0f, 0.0f);
    cloud.scale.emplace_back(0.1f, 0.1f, 0.02f);
    cloud.opacity.push_back(0.5f);
    cloud.sh.emplace_back(0.0f);
  }
  return cloud;
}

/// The map of a cloud of metres with z up.
inline walk::WalkMap map_of(const GaussianCloud& cloud, const glm::vec3& start, int threads = 2) {
  ThreadPool pool(threads);
  walk::Occupancy occupancy(walk::grid_around(start, {0, 0, 1}, eye_m));
  occupancy.add(cloud, pool);
  return walk::find_walkable_area(occupancy, {}, start, "test", pool);
}

}  // namespace catgs::test

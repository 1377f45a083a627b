#pragma once

#include <vector>

#include <glm/vec3.hpp>

#include "render_core/math/camera.h"
#include "render_core/scene/analysis/voxel_grid.h"
#include "render_core/scene/gaussian_cloud.h"
#include "render_core/scene/scene.h"

namespace catgs::first_sight {

/// The subject of a view from outside: its large connected parts, without stray Gaussians.
struct Content {
  Bounds bounds;                     // of the places
  std::vector<glm::vec3> positions;  // an even sample of its occupied cells
  float radius = 0.0f;               // of the ball around a cell
};

/// The connected groups of occupied cells that hold more than a hundredth of the largest one's
/// cells. Where no cell is occupied, the corners of `core`, the box of most of the scene.
Content find_content(const VoxelGrid& grid, const Bounds& core);

struct OuterView {
  Pose pose;
  float nearest = 0.0f;   // depth of the content's nearest place
  float distance = 0.0f;  // depth of the middle of the content
};

/// The nearest view along `forward` (unit) that has the whole content in the picture, with a
/// margin.
OuterView fit(const Content& content, const glm::vec3& forward, const glm::vec3& up);

}  // namespace catgs::first_sight

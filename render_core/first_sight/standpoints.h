#pragma once

#include <vector>

#include "render_core/base/thread_pool.h"
#include "render_core/math/camera.h"
#include "render_core/scene/analysis/voxel_grid.h"
#include "render_core/scene/scene.h"

namespace catgs::first_sight {

/// A view from a place inside of the scene.
struct InnerView {
  Pose pose;
  float openness = 0.0f;  // how much and how far it sees, 0…1
  float ahead = 0.0f;     // mean distance of what is in the middle of the picture, world units
  float height = 0.0f;    // above the ground, world units
};

struct Inside {
  float share = 0.0f;            // of the box: free, and surrounded on nearly all sides
  std::vector<InnerView> views;  // the most open ones, apart from each other
};

/// Looks for free space in `box` that the scene surrounds.
Inside look_inside(const VoxelGrid& grid, const Bounds& box, const glm::vec3& up, ThreadPool& pool);

}  // namespace catgs::first_sight

#pragma once

#include <vector>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "render_core/image/image.h"
#include "tests/load/warp.h"

namespace catgs::load {

// The page's warp by depths (web_client/src/present/depth_mesh.ts). tests/support/warp_golden.json
// holds both to the same numbers.

/// The depth grid of a picture.
struct Depths {
  glm::ivec2 cells{0};                // columns and rows; 0: not known
  std::vector<float> inverse_depths;  // by rows from the top, 1 / world units
};

/// The distance of the plane that stands for all of a picture where one is enough.
double median_distance(const Depths& depths);

/// A point of the mesh that is laid over a picture.
struct MeshPoint {
  glm::dvec2 picture;  // -1…1 across the picture, y down; the outermost points lie beyond
  double inverse_depth = 0.0;
  glm::dvec3 view;  // the same in the view, homogeneous; z is view depth times inverse_depth
};

/// A point in the middle of each cell, and a frame of points around them with the inverse depths of
/// the outermost cells. By rows, (columns + 2) x (rows + 2).
std::vector<MeshPoint> mesh_points(const Depths& depths, const Eye& picture, const Eye& view,
                                   double picture_aspect, double view_aspect);

/// The picture on its mesh as the view sees it: what is near covers what is far. Between surfaces
/// it is stretched, and its border is repeated outside of it.
Image warp_by_depths(const Image& picture, const Depths& depths, const Eye& picture_eye,
                     const Eye& view, double view_aspect, glm::ivec2 size_px);

}  // namespace catgs::load

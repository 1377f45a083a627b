#pragma once

#include "render_core/math/camera.h"
#include "render_core/math/plane_maps.h"

namespace catgs {

// The grid that a key frame's tile lists belong to, and what sub-frames need to find their lists in
// it.

/// How the tiles of a key frame's lists lie in the pictures of its sub-frames.
enum class GridKind {
  fixed,  // same place as in the key frame: trails cover rotation too (the paper)
  shift,  // moved by whole pixels, as the middle of the picture moves in a turn of the camera
  warp,   // turned with the camera: only its translation moves a Gaussian between tiles
};

/// Squares of tile_size_px in the key frame's image plane. Tile (0, 0) begins at pixel first_px.
/// Grids for sub-frames exceed the image on the side that the camera turns to.
struct TileGrid {
  glm::ivec2 first_px{0};
  glm::ivec2 tiles{0};
  // Extent of the lists, from first_px on: up to the image's edge, or up to the end of the last
  // tile.
  glm::ivec2 size_px{0};
};

/// The tiles of an image, without any beyond it.
TileGrid image_grid(glm::ivec2 size_px);

/// The tiles around the pixels low…high of an image plane.
TileGrid covering_grid(const glm::dvec2& low, const glm::dvec2& high);

/// Maps the pixels of a camera at `pose` to those of `key`, which differs in its pose only. Holds
/// for points at infinity.
Homography<double> image_turn(const Camera& key, const Pose& pose);

/// Angle between the view axes, rad.
double axis_turn_rad(const Pose& a, const Pose& b);

/// Place of a key frame's grid in the picture of a camera at `pose`, by GridKind::shift. Pixel p of
/// that picture uses the lists of pixel p + image_shift_px() of the key frame.
glm::ivec2 image_shift_px(const Camera& key, const Pose& pose);

/// The cameras around the forecast path that the lists of a key frame must serve, and the grid that
/// they need.
struct GuardSet {
  double max_turn_rad = 0.0;      // of the view axis
  double max_rotation_rad = 0.0;  // of the camera, its roll included
  double tau = 0.0;               // world units that the camera may be off its path
  TileGrid grid;                  // corners of the picture stay in it
};

/// World units that a guard set may reach off the path: little compared with the nearest visible
/// depth.
double most_tau(const Camera& key);

/// The guard set of a key frame whose camera is expected to move uniformly to `end`. `tau` in world
/// units, at most most_tau(). Where the camera turns too far for any grid, `end` is not in the set.
GuardSet make_guard_set(const Camera& key, const Pose& end, double tau);

/// Whether a camera is in the guard set. It should be somewhere between `key` and `end`.
bool in_guard_set(const GuardSet& guard, const Camera& key, const Pose& end, const Pose& pose);

/// The growth that makes lists hold for the whole guard set.
ListGrowth<double> list_growth(const Camera& key, const GuardSet& guard);

/// The near plane for lists, world units: a turn brings Gaussians at the picture's edges farther
/// from the camera's plane, so lists hold some that are nearer.
float guarded_near_z(const Camera& key, const GuardSet& guard);

}  // namespace catgs

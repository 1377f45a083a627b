#pragma once

#include "render_core/math/camera.h"
#include "render_core/math/plane_maps.h"

namespace catgs {

// Where the tile lists of a key frame live, and what its sub-frames need to find them.

/// How the tiles of a key frame's lists lie in the pictures of its sub-frames.
enum class GridKind {
  fixed,  // where they are in the key frame: trails cover rotation too (the paper)
  shift,  // moved by whole pixels, as the middle of the picture moves when the camera turns
  warp,   // turned with the camera: only its translation moves a Gaussian between tiles
};

/// Squares of tile_size_px in the key frame's image plane. Tile (0, 0) begins at pixel
/// first_px; grids of sub-frames exceed the image where the camera turns to.
struct TileGrid {
  glm::ivec2 first_px{0};
  glm::ivec2 tiles{0};
  // Where lists end, from first_px on: at the image's edge, or with the last tile.
  glm::ivec2 size_px{0};
};

/// The tiles of an image alone.
TileGrid image_grid(glm::ivec2 size_px);

/// The tiles around the pixels low…high of an image plane.
TileGrid covering_grid(const glm::dvec2& low, const glm::dvec2& high);

/// From the pixels of a camera at `pose` to those of `key`, which differs in its pose only, for
/// what is infinitely far away.
Homography<double> image_turn(const Camera& key, const Pose& pose);

/// Angle between the view axes, rad.
double axis_turn_rad(const Pose& a, const Pose& b);

/// Where the grid of a key frame lies in the picture of a camera at `pose`, by GridKind::shift:
/// that picture's pixel p has the lists of pixel p + image_shift_px() of the key frame.
glm::ivec2 image_shift_px(const Camera& key, const Pose& pose);

/// Around an image that the camera may turn under: the cameras of a guard set and what they need.
struct GuardSet {
  double max_turn_rad = 0.0;      // of the view axis
  double max_rotation_rad = 0.0;  // of the camera, its roll included
  double tau = 0.0;               // world units that the camera may be off its path
  TileGrid grid;                  // that corners of the picture stay in
};

/// World units that a guard set may reach off the path: little beside the nearest that is seen.
double most_tau(const Camera& key);

/// The guard set of a key frame from which the camera is expected to move uniformly to `end`.
/// `tau` in world units, no more than most_tau(). Where the camera turns too far for any grid,
/// `end` is not in the set.
GuardSet make_guard_set(const Camera& key, const Pose& end, double tau);

/// Whether a camera that should be somewhere between `key` and `end` is in the guard set.
bool in_guard_set(const GuardSet& guard, const Camera& key, const Pose& end, const Pose& pose);

/// What lists need that shall hold in the whole guard set.
ListGrowth<double> list_growth(const Camera& key, const GuardSet& guard);

/// The nearest that lists have to hold Gaussians for: a turn brings those at the picture's edges
/// farther from the camera's plane. World units.
float guarded_near_z(const Camera& key, const GuardSet& guard);

}  // namespace catgs

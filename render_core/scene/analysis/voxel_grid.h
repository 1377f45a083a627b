#pragma once

#include <vector>

#include <glm/vec3.hpp>

#include "render_core/scene/gaussian_cloud.h"

namespace catgs {

/// The light that the scene stops, on a coarse grid of cubes around a point: each cell has the
/// optical depth for a ray through it. For choosing places for a camera, not for pictures.
class VoxelGrid {
 public:
  /// Covers centre ± half_size along each axis. Large scenes are judged by an even sample.
  VoxelGrid(const GaussianCloud& cloud, const glm::vec3& centre, float half_size);

  [[nodiscard]] float cell_size() const { return cell_size_; }

  /// Optical depth of the cell that holds `position`; 0 outside of the grid.
  [[nodiscard]] float depth_at(const glm::vec3& position) const;

  /// Sum of the optical depths of the cell that holds `position` and its 26 neighbours.
  [[nodiscard]] float depth_around(const glm::vec3& position) const;

 private:
  static constexpr int cells_per_side = 80;
  void add(const glm::vec3& position, float area);
  void add_gaussian(const GaussianCloud& cloud, std::size_t i, float weight);
  [[nodiscard]] const float* cell_at(const glm::vec3& position) const;

  glm::vec3 corner_;
  float cell_size_;
  std::vector<float> depth_;
};

}  // namespace catgs

#pragma once

#include <cstddef>
#include <limits>
#include <vector>

#include <glm/vec3.hpp>

#include "render_core/scene/gaussian_cloud.h"
#include "render_core/scene/scene.h"

namespace catgs {

/// The light that the scene stops, on a grid of cubes over a box: each cell has the optical depth
/// for a ray through it. For choosing places for a camera, not for pictures.
class VoxelGrid {
 public:
  static constexpr float never = std::numeric_limits<float>::infinity();

  /// At most about 2^21 cells. Each Gaussian stands for `stands_for` of the scene.
  VoxelGrid(const GaussianCloud& cloud, const Bounds& box, float stands_for = 1.0f);

  [[nodiscard]] float cell_size() const { return cell_size_; }
  [[nodiscard]] const glm::ivec3& size() const { return size_; }
  [[nodiscard]] glm::vec3 centre_of(const glm::ivec3& cell) const {
    return corner_ + cell_size_ * (glm::vec3(cell) + 0.5f);
  }
  [[nodiscard]] std::size_t index_of(const glm::ivec3& cell) const {
    return (static_cast<std::size_t>(cell.z) * static_cast<std::size_t>(size_.y) +
            static_cast<std::size_t>(cell.y)) *
               static_cast<std::size_t>(size_.x) +
           static_cast<std::size_t>(cell.x);
  }

  /// Optical depth of each cell, by index_of().
  [[nodiscard]] const std::vector<float>& depths() const { return depth_; }

  /// Optical depth of the cell that holds `position`; 0 outside of the grid.
  [[nodiscard]] float depth_at(const glm::vec3& position) const;

  /// Sum of the optical depths of the cell that holds `position` and its 26 neighbours.
  [[nodiscard]] float depth_around(const glm::vec3& position) const;

  /// Distance from `from` along the unit vector `ray` at which half of the light is stopped;
  /// `never` where the ray leaves the grid before.
  [[nodiscard]] float distance_along(const glm::vec3& from, const glm::vec3& ray) const;

 private:
  void add(const glm::vec3& position, float area);
  void add_gaussian(const GaussianCloud& cloud, std::size_t i, float weight);
  [[nodiscard]] const float* cell_at(const glm::vec3& position) const;

  glm::vec3 corner_;
  float cell_size_;
  glm::ivec3 size_;
  std::vector<float> depth_;
};

}  // namespace catgs

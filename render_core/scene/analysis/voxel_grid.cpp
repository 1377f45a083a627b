#include "render_core/scene/analysis/voxel_grid.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>

#include <glm/common.hpp>
#include <glm/mat3x3.hpp>

namespace catgs {

namespace {

constexpr float max_cells = 2097152.0f;
constexpr float two_pi = 6.2831853f;

}  // namespace

VoxelGrid::VoxelGrid(const GaussianCloud& cloud, const Bounds& box, float stands_for)
    : corner_(box.min) {
  // A flat box keeps some height, so that the number of cells stays bounded.
  const glm::vec3 extent = box.max - box.min;
  const float longest = std::max({extent.x, extent.y, extent.z, 1e-6f});
  const glm::vec3 sides = glm::max(extent, glm::vec3(0.01f * longest));
  cell_size_ = std::cbrt(sides.x * sides.y * sides.z / max_cells);
  size_ = glm::ivec3(glm::ceil(sides / cell_size_));
  depth_.resize(index_of({0, 0, size_.z}));
  for (std::size_t i = 0; i < cloud.size(); ++i) add_gaussian(cloud, i, stands_for);
}

/// A Gaussian stops opacity * 2 pi s t of the light (its integral over the plane of its two larger
/// standard deviations). One larger than a cell is spread over points of that plane.
void VoxelGrid::add_gaussian(const GaussianCloud& cloud, std::size_t i, float weight) {
  const glm::vec3& scale = cloud.scale[i];
  std::array<int, 3> axes = {0, 1, 2};
  std::sort(axes.begin(), axes.end(), [&](int a, int b) { return scale[a] > scale[b]; });
  const glm::mat3 rotation = glm::mat3_cast(cloud.rotation[i]);
  const glm::vec3 u = rotation[axes[0]] * scale[axes[0]], v = rotation[axes[1]] * scale[axes[1]];
  const float area = cloud.opacity[i] * two_pi * scale[axes[0]] * scale[axes[1]] * weight;
  const auto points = [&](float s) {
    return static_cast<int>(std::clamp(std::ceil(2.0f * s / cell_size_), 1.0f, 8.0f));
  };
  const int rows = points(scale[axes[0]]), columns = points(scale[axes[1]]);
  const auto point = [](int k, int n) {  // -1.5…1.5 standard deviations, evenly
    return 1.5f * (static_cast<float>(2 * k + 1) / static_cast<float>(n) - 1.0f);
  };
  for (int row = 0; row < rows; ++row)
    for (int column = 0; column < columns; ++column)
      add(cloud.mean[i] + u * point(row, rows) + v * point(column, columns),
          area / static_cast<float>(rows * columns));
}

const float* VoxelGrid::cell_at(const glm::vec3& position) const {
  const glm::vec3 cell = (position - corner_) / cell_size_;
  for (int k = 0; k < 3; ++k)
    if (!(cell[k] >= 0.0f && cell[k] < static_cast<float>(size_[k]))) return nullptr;
  return depth_.data() + index_of(glm::ivec3(cell));
}

void VoxelGrid::add(const glm::vec3& position, float area) {
  if (const float* cell = cell_at(position))
    depth_[static_cast<std::size_t>(cell - depth_.data())] += area / (cell_size_ * cell_size_);
}

float VoxelGrid::depth_at(const glm::vec3& position) const {
  const float* cell = cell_at(position);
  return cell ? *cell : 0.0f;
}

float VoxelGrid::depth_around(const glm::vec3& position) const {
  float sum = 0.0f;
  for (int x = -1; x <= 1; ++x)
    for (int y = -1; y <= 1; ++y)
      for (int z = -1; z <= 1; ++z) sum += depth_at(position + cell_size_ * glm::vec3(x, y, z));
  return sum;
}

float VoxelGrid::distance_along(const glm::vec3& from, const glm::vec3& ray) const {
  constexpr float half_stopped = 0.6931472f;  // ln 2
  float stopped = 0.0f;
  // Far from the origin a step may be lost in rounding, so that the ray never leaves.
  const int most_steps = size_.x + size_.y + size_.z;
  for (int step = 1; step <= most_steps; ++step) {
    const float distance = static_cast<float>(step) * cell_size_;
    const float* cell = cell_at(from + distance * ray);
    if (!cell) return never;
    stopped += *cell;
    if (stopped > half_stopped) return distance;
  }
  return never;
}

}  // namespace catgs

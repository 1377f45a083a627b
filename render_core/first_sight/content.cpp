#include "render_core/first_sight/content.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/vector_relational.hpp>

#include "render_core/base/even_sample.h"
#include "render_core/first_sight/lens.h"
#include "render_core/math/look_at.h"

namespace catgs::first_sight {
namespace {

constexpr float occupied = 0.3f;  // optical depth: a quarter of the light is stopped

using Group = std::vector<glm::ivec3>;

/// The occupied cells that can be reached from `seed` over neighbours; marks them as taken.
Group group_from(const glm::ivec3& seed, const VoxelGrid& grid, std::vector<bool>& taken) {
  Group cells = {seed};
  taken[grid.index_of(seed)] = true;
  for (std::size_t next = 0; next < cells.size(); ++next) {
    const glm::ivec3 from = glm::max(cells[next] - 1, glm::ivec3(0));
    const glm::ivec3 to = glm::min(cells[next] + 1, grid.size() - 1);
    for (int z = from.z; z <= to.z; ++z)
      for (int y = from.y; y <= to.y; ++y)
        for (int x = from.x; x <= to.x; ++x) {
          const std::size_t i = grid.index_of({x, y, z});
          if (taken[i] || grid.depths()[i] < occupied) continue;
          taken[i] = true;
          cells.push_back({x, y, z});
        }
  }
  return cells;
}

std::vector<Group> find_groups(const VoxelGrid& grid) {
  std::vector<bool> taken(grid.depths().size());
  std::vector<Group> groups;
  for (int z = 0; z < grid.size().z; ++z)
    for (int y = 0; y < grid.size().y; ++y)
      for (int x = 0; x < grid.size().x; ++x) {
        const std::size_t i = grid.index_of({x, y, z});
        if (!taken[i] && grid.depths()[i] >= occupied)
          groups.push_back(group_from({x, y, z}, grid, taken));
      }
  return groups;
}

Content corners_of(const Bounds& box, float radius) {
  Content content{box, {}, radius};
  for (int i = 0; i < 8; ++i)
    content.positions.push_back({(i & 1 ? box.max : box.min).x, (i & 2 ? box.max : box.min).y,
                                 (i & 4 ? box.max : box.min).z});
  return content;
}

}  // namespace

Content find_content(const VoxelGrid& grid, const Bounds& core) {
  constexpr std::size_t max_positions = 8192;
  std::vector<Group> groups = find_groups(grid);
  const float radius = 0.5f * std::sqrt(3.0f) * grid.cell_size();
  if (groups.empty()) return corners_of(core, radius);
  const std::size_t largest = std::ranges::max_element(groups, {}, &Group::size)->size();
  std::erase_if(groups, [&](const Group& group) { return 100 * group.size() <= largest; });
  std::size_t total = 0;
  for (const Group& group : groups) total += group.size();

  const EvenSample even(total, max_positions);
  const glm::vec3 first = grid.centre_of(groups.front().front());
  Content content{{first, first}, {}, radius};
  std::size_t next = 0;
  for (const Group& group : groups)
    for (const glm::ivec3& cell : group) {
      const glm::vec3 position = grid.centre_of(cell);
      content.bounds.min = glm::min(content.bounds.min, position);
      content.bounds.max = glm::max(content.bounds.max, position);
      if (even.contains(next++)) content.positions.push_back(position);
    }
  return content;
}

/// In camera axes with z forward, a ball of radius r is inside of the picture's left and right
/// border when |x - cx| + r sqrt(1 + k²) <= k (z - cz). Both borders touch the content when the
/// camera stands at the crossing of the two lines that bound it: with A = max(x - k z) and B =
/// max(-x - k z), both plus r sqrt(1 + k²), at cx = (A - B) / 2 and cz = -(A + B) / 2k. The same
/// holds for y; the farther of the two distances counts.
///
/// Places are those around the content's middle: far from the origin, others have few digits.
OuterView fit(const Content& content, const glm::vec3& forward, const glm::vec3& up) {
  constexpr float margin = 0.88f;
  const glm::vec3 middle = 0.5f * (content.bounds.min + content.bounds.max);
  const Pose turned = look_at(glm::vec3(0), forward, up);
  const glm::mat3 to_camera = camera_from_world_rotation(turned);
  const float k[2] = {margin * half_width, margin * half_height};
  glm::vec2 high(std::numeric_limits<float>::lowest()), low = high;
  glm::vec2 depth(std::numeric_limits<float>::max(), std::numeric_limits<float>::lowest());
  for (const glm::vec3& position : content.positions) {
    const glm::vec3 p = to_camera * (position - middle);
    depth = {std::min(depth.x, p.z), std::max(depth.y, p.z)};
    for (int axis = 0; axis < 2; ++axis) {
      const float ball = content.radius * std::sqrt(1.0f + k[axis] * k[axis]);
      high[axis] = std::max(high[axis], p[axis] - k[axis] * p.z + ball);
      low[axis] = std::max(low[axis], -p[axis] - k[axis] * p.z + ball);
    }
  }
  const glm::vec2 centre = 0.5f * (high - low);
  const float z = std::min(-0.5f * (high.x + low.x) / k[0], -0.5f * (high.y + low.y) / k[1]);
  return {{middle + turned.orientation * glm::vec3(centre, z), turned.orientation},
          depth.x - z,
          0.5f * (depth.x + depth.y) - z};
}

}  // namespace catgs::first_sight

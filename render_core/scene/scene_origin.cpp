#include "render_core/scene/scene_origin.h"

#include <algorithm>
#include <vector>

#include <glm/geometric.hpp>

#include "render_core/base/even_sample.h"
#include "render_core/math/camera.h"

namespace catgs {

glm::dvec3 find_origin(std::span<const glm::vec3> positions) {
  const EvenSample even(positions.size(), most_origin_positions);
  std::vector<glm::vec3> sample;
  for (std::size_t k = 0; k < even.size(); ++k)  // NaN is not within
    if (const glm::vec3& position = positions[even[k]];
        glm::all(glm::lessThanEqual(glm::abs(position), glm::vec3(max_coordinate))))
      sample.push_back(position);
  if (sample.empty()) return glm::dvec3(0.0);
  glm::dvec3 medians;
  std::vector<float> values(sample.size());
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  for (int axis = 0; axis < 3; ++axis) {
    std::ranges::transform(sample, values.begin(), [&](const glm::vec3& p) { return p[axis]; });
    std::nth_element(values.begin(), middle, values.end());
    medians[axis] = static_cast<double>(*middle);
  }
  if (origin_near(medians) == glm::dvec3(0.0)) return glm::dvec3(0.0);
  // The medians may take one axis each of two equal parts far apart.
  return origin_near(*std::ranges::min_element(
      sample, {}, [&](const glm::vec3& p) { return glm::distance(glm::dvec3(p), medians); }));
}

void move_origin(GaussianCloud& cloud, const glm::dvec3& by) {
  if (by == glm::dvec3(0.0)) return;
  for (glm::vec3& mean : cloud.mean) mean = glm::vec3(glm::dvec3(mean) - by);
}

}  // namespace catgs

#pragma once

#include <cstddef>
#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <glm/vec3.hpp>

#include "render_core/scene/gaussian_cloud.h"

namespace catgs {

/// Collects what a file of a format would not hold of a cloud, for people: see SceneFormat::losses.
class Losses {
 public:
  explicit Losses(const GaussianCloud& cloud) : cloud_(cloud) {}

  /// Tells how many Gaussians are smaller than the largest step between positions around them.
  void positions(const std::function<float(const glm::vec3& mean)>& step_at);
  /// Tells how many have another mean in the file, because they are far from all others.
  void moved(std::span<const glm::vec3> stored);
  /// Tells how many become larger or smaller: those whose middle scale is outside least…most.
  void scales(float least, float most);
  /// Tells how many have a coefficient of a degree in first…last outside ±most. `what`: the values.
  void harmonics(int first, int last, float least, float most, std::string_view what);
  void add(std::string_view note) { notes_.emplace_back(note); }

  [[nodiscard]] std::vector<std::string> notes() && { return std::move(notes_); }

 private:
  [[nodiscard]] std::string share(std::size_t count) const;

  const GaussianCloud& cloud_;
  std::vector<std::string> notes_;
};

/// The second of the three scales: a thinner one is not seen, and a needle has one that is longer.
float middle_scale(const glm::vec3& scale);

}  // namespace catgs

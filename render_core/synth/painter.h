#pragma once

#include <cassert>
#include <cstddef>
#include <cstdint>

#include <glm/gtc/quaternion.hpp>
#include <glm/vec3.hpp>

#include "render_core/scene/gaussian_cloud.h"
#include "render_core/synth/light.h"
#include "render_core/synth/random.h"
#include "render_core/synth/shadows.h"

namespace catgs::synth {

inline constexpr glm::vec3 up(0.0f, -1.0f, 0.0f);

/// World point from city coordinates: x and z on the ground, height above it.
inline glm::vec3 at(float x, float height, float z) { return {x, -height, z}; }

/// Rotation whose columns are the unit axes x, y and x cross y.
glm::quat rotation_of(const glm::vec3& x, const glm::vec3& y);

/// Uniformly distributed rotation.
glm::quat random_rotation(Random& random);

/// One Gaussian, before its view dependence is folded into coefficients.
struct Splat {
  glm::vec3 mean;
  glm::quat rotation;
  glm::vec3 scale;
  float opacity;
  glm::vec3 colour;
  const Lobe* lobe = nullptr;  // null: same colour from all sides
  float lobe_gain = 1.0f;
};

/// Writes a part of a scene into its range of the cloud, shared out by weight.
///
/// A part is described by code that calls `take(weight)` for every piece, in a fixed order, and
/// `put`s as many Gaussians as take() returned. The code runs twice. The first run measures the sum
/// of weights; take() returns 0. The second run paints; piece k gets floor(n (w_0 + … + w_k) / W)
/// minus the Gaussians of earlier pieces. Exactly n Gaussians result for any n, a piece of weight w
/// gets w n / W within one, and no list of pieces is stored. Only the painted colours and positions
/// may depend on `measuring()`.
class Painter {
 public:
  /// For measuring.
  Painter(const Light& light, Shadows& shadows) : light_(light), shadows_(shadows) {}

  /// For painting [first, first + count) of the cloud, given the measured `total_weight`.
  Painter(const Light& light, Shadows& shadows, GaussianCloud& cloud, std::size_t first,
          std::size_t count, double total_weight)
      : light_(light),
        shadows_(shadows),
        cloud_(&cloud),
        next_(first),
        share_{count, total_weight} {}

  [[nodiscard]] bool measuring() const { return cloud_ == nullptr || measuring_; }
  [[nodiscard]] double measured() const { return share_.sum; }
  [[nodiscard]] const Light& light() const { return light_; }
  [[nodiscard]] Shadows& shadows() { return shadows_; }

  /// The number of Gaussians that a piece of this weight (>= 0) has to put.
  std::size_t take(double weight);

  void put(const Splat& splat);

  /// Shares `count` Gaussians (the result of a take()) out among the pieces of `paint(*this)`, by
  /// their own weights.
  template <typename Paint>
  void divide(std::size_t count, const Paint& paint) {
    if (count == 0) return;
    const Share outer = share_;
    share_ = {0, 0.0};
    measuring_ = true;
    paint(*this);
    measuring_ = false;
    share_ = {count, share_.sum};
    [[maybe_unused]] const std::size_t end = next_ + count;
    paint(*this);
    assert(next_ == end && "a piece took Gaussians and did not put them");
    share_ = outer;
  }

 private:
  struct Share {
    std::size_t count = 0;  // to share out
    double total = 0.0;     // weight of all pieces
    double sum = 0.0;       // weight of the pieces so far
    std::size_t given = 0;
  };

  const Light& light_;
  Shadows& shadows_;
  GaussianCloud* cloud_ = nullptr;
  std::size_t next_ = 0;
  bool measuring_ = false;
  Share share_;
};

}  // namespace catgs::synth

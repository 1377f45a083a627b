#include "render_core/synth/painter.h"

#include <cassert>

#include <glm/geometric.hpp>

namespace catgs::synth {
namespace {

// One rounding step below sh_basis_0: another value would change the bytes of every made scene.
constexpr float sh_constant = 0.28209479f;

}  // namespace

glm::quat rotation_of(const glm::vec3& x, const glm::vec3& y) {
  // Shepperd's method: divide by the largest component, never by a small one.
  const glm::vec3 z = glm::cross(x, y);
  const float trace = x.x + y.y + z.z;
  glm::quat q(1.0f, 0.0f, 0.0f, 0.0f);
  if (trace > 0.0f) {
    q = glm::quat(1.0f + trace, y.z - z.y, z.x - x.z, x.y - y.x);
  } else if (x.x >= y.y && x.x >= z.z) {
    q = glm::quat(y.z - z.y, 1.0f + x.x - y.y - z.z, x.y + y.x, z.x + x.z);
  } else if (y.y >= z.z) {
    q = glm::quat(z.x - x.z, x.y + y.x, 1.0f + y.y - x.x - z.z, y.z + z.y);
  } else {
    q = glm::quat(x.y - y.x, z.x + x.z, y.z + z.y, 1.0f + z.z - x.x - y.y);
  }
  const float length = std::sqrt(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w);
  return {q.w / length, q.x / length, q.y / length, q.z / length};
}

glm::quat random_rotation(Random& random) {  // Shoemake 1992, "Uniform random rotations"
  const float u = random.uniform();
  const SinCos a = sin_cos_turns(random.uniform());
  const SinCos b = sin_cos_turns(random.uniform());
  const float r1 = std::sqrt(1.0f - u);
  const float r2 = std::sqrt(u);
  return {r2 * b.cos, r1 * a.sin, r1 * a.cos, r2 * b.sin};
}

std::size_t Painter::take(double weight) {
  assert(weight >= 0.0);
  share_.sum += weight;
  if (measuring()) return 0;
  // Measuring and painting add the same numbers in the same order. For the last piece sum equals
  // total to the bit, so it gets all that is left.
  const std::size_t target = share_.sum >= share_.total
                                 ? share_.count
                                 : static_cast<std::size_t>(static_cast<double>(share_.count) *
                                                            (share_.sum / share_.total));
  const std::size_t got = target - share_.given;
  share_.given = target;
  return got;
}

void Painter::put(const Splat& splat) {
  GaussianCloud& cloud = *cloud_;
  const std::size_t i = next_++;
  assert(i < cloud.size());
  cloud.mean[i] = splat.mean;
  cloud.rotation[i] = splat.rotation;
  cloud.scale[i] = splat.scale;
  cloud.opacity[i] = splat.opacity;
  constexpr std::size_t coefficients = sh_coefficient_count(max_sh_degree);
  glm::vec3* sh = cloud.sh.data() + i * coefficients;
  sh[0] = (splat.colour - 0.5f) / sh_constant;
  if (splat.lobe != nullptr) {
    sh[0] += (*splat.lobe)[0] * splat.lobe_gain;
    for (std::size_t k = 1; k < coefficients; ++k) sh[k] = (*splat.lobe)[k] * splat.lobe_gain;
  }
}

}  // namespace catgs::synth

#pragma once

#include <cstdint>

#include "render_core/synth/exact_math.h"

namespace catgs::synth {

/// Key of a part of a whole. Children of one key are independent of each other.
constexpr std::uint64_t child(std::uint64_t key, std::uint64_t index) {
  return mix_bits(key ^ mix_bits(index + golden_gamma));
}

/// Counter-based random numbers. Draw n of a key is a pure function of (key, n), so every part of a
/// scene can be made alone, in any order, on any thread. C++ does not define the order in which a
/// call's arguments or an operator's operands are evaluated, so two draws in one expression are
/// allowed only inside braces.
class Random {
 public:
  explicit Random(std::uint64_t key) : bits_(key) {}

  std::uint64_t bits() { return bits_.next(); }

  /// In [0, 1), 24 bits.
  float uniform() { return static_cast<float>(bits() >> 40) * 0x1p-24f; }
  float uniform(float low, float high) { return low + (high - low) * uniform(); }
  bool chance(float probability) { return uniform() < probability; }
  int below(int count) {
    return static_cast<int>((bits() >> 32) * static_cast<unsigned>(count) >> 32);
  }

  /// Mean 0, variance 1, within 3.5: the sum of four uniform numbers. Its missing tails keep sizes
  /// bounded.
  float normal() {
    const std::uint64_t b = bits();
    const auto sum =
        static_cast<float>((b & 0xffff) + (b >> 16 & 0xffff) + (b >> 32 & 0xffff) + (b >> 48));
    return (sum * 0x1p-16f - 2.0f) * 1.7320508f;
  }

  /// Log-normal with median 1.
  float spread(float sigma) { return exp_exact(sigma * normal()); }

 private:
  SplitMix64 bits_;
};

/// Smooth noise in [0, 1] over the plane, one feature per unit.
inline float value_noise(std::uint64_t key, float x, float y) {
  const float fx = std::floor(x);
  const float fy = std::floor(y);
  const auto corner = [&](int dx, int dy) {
    const auto ix = static_cast<std::uint32_t>(static_cast<std::int32_t>(fx) + dx);
    const auto iy = static_cast<std::uint32_t>(static_cast<std::int32_t>(fy) + dy);
    return static_cast<float>(mix_bits(key ^ (std::uint64_t{ix} << 32 | iy)) >> 40) * 0x1p-24f;
  };
  const float tx = smooth_step(0.0f, 1.0f, x - fx);
  const float ty = smooth_step(0.0f, 1.0f, y - fy);
  return blend(blend(corner(0, 0), corner(1, 0), tx), blend(corner(0, 1), corner(1, 1), tx), ty);
}

/// Sum of `octaves` noises, each twice as fine and half as strong; in [0, 1].
inline float fractal_noise(std::uint64_t key, float x, float y, int octaves) {
  float sum = 0.0f;
  float total = 0.0f;
  float weight = 1.0f;
  for (int o = 0; o < octaves; ++o) {
    sum += weight * value_noise(child(key, static_cast<std::uint64_t>(o)), x, y);
    total += weight;
    weight *= 0.5f;
    x *= 2.0f;
    y *= 2.0f;
  }
  return sum / total;
}

}  // namespace catgs::synth

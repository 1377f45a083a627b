#pragma once

#include <cstdint>

#include "render_core/base/portable.h"

namespace catgs {

// Building blocks of pose scripts that give the same bits on every machine: integer random numbers,
// and arithmetic in double with + - * / and sqrt only, which IEEE 754 rounds exactly.

/// Random doubles, good enough to place waypoints.
class PortableRng : public SplitMix64 {
 public:
  using SplitMix64::SplitMix64;

  /// Uniform in [low, high).
  double uniform(double low, double high) {
    return low + (high - low) * (static_cast<double>(next() >> 11) * 0x1p-53);
  }
  /// Mean 0, variance 1, within -6…6: the sum of twelve uniform numbers (Irwin-Hall).
  double normal() {
    double sum = -6.0;
    for (int i = 0; i < 12; ++i) sum += uniform(0.0, 1.0);
    return sum;
  }
  bool coin() { return (next() >> 63) != 0; }
};

/// Error below 1e-15 for |angle_rad| <= 1e6.
SinCos<double> portable_sincos(double angle_rad);

/// Smooth noise: a random value in [-1, 1] at each integer of `x`, quintic between (twice
/// differentiable). The channel picks one of independent noises.
double value_noise(std::uint64_t seed, std::uint32_t channel, double x);

/// Goes from 0 to 1 over [0, 1] with the least jerk, as people reach or turn (Flash and Hogan
/// 1985); clamped outside. Its largest slope is 1.875.
constexpr double minimum_jerk(double x) {
  if (x <= 0.0) return 0.0;
  if (x >= 1.0) return 1.0;
  return x * x * x * (10.0 + x * (6.0 * x - 15.0));
}

}  // namespace catgs

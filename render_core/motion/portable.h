#pragma once

#include <cstdint>

namespace catgs {

// Building blocks of pose scripts that give the same bits on every machine: integer random numbers,
// and double arithmetic of + - * / and sqrt only, which IEEE 754 rounds exactly. (sin and cos of
// the C library differ by a last bit between its versions; the distributions of <random> between
// standard libraries.)

/// SplitMix64 (Steele, Lea, Flood 2014): 64 bits of state, good enough to place waypoints.
class PortableRng {
 public:
  explicit PortableRng(std::uint64_t seed) : state_(seed) {}

  std::uint64_t next() {
    std::uint64_t z = (state_ += 0x9e3779b97f4a7c15u);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
  }
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

 private:
  std::uint64_t state_;
};

struct SinCos {
  double sin;
  double cos;
};

/// Error below 1e-15 for |angle_rad| <= 1e6.
SinCos portable_sincos(double angle_rad);

/// Smooth noise: a random value in [-1, 1] at each integer of `x`, quintic between (twice
/// differentiable). The channel picks one of independent noises.
double value_noise(std::uint64_t seed, std::uint32_t channel, double x);

/// Goes from 0 to 1 over [0, 1] with the least jerk, as a reaching or turning person does (Flash
/// and Hogan 1985); clamped outside. Its largest slope is 1.875.
constexpr double minimum_jerk(double x) {
  if (x <= 0.0) return 0.0;
  if (x >= 1.0) return 1.0;
  return x * x * x * (10.0 + x * (6.0 * x - 15.0));
}

}  // namespace catgs

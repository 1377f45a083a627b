#include "render_core/motion/portable.h"

#include <cmath>
#include <numbers>

namespace catgs {

SinCos<double> portable_sincos(double angle_rad) {
  // angle = quarter * pi/2 + r with |r| <= pi/4. The high part of pi/2 has 33 bits, so that its
  // product with a quarter below 2^20 is exact (Cody and Waite's reduction).
  constexpr double half_pi_high = 0x1.921fb544p+0;
  constexpr double half_pi_low = 0x1.0b4611a626331p-34;
  const double quarter = std::floor(angle_rad * (2.0 / std::numbers::pi) + 0.5);
  const double r = (angle_rad - quarter * half_pi_high) - quarter * half_pi_low;
  const double r2 = r * r;
  // Taylor series; the first term left out is below 1e-17 on |r| <= pi/4.
  double sine = 0.0;
  for (int n = 17; n >= 3; n -= 2) sine = (1.0 + sine) * (-r2 / ((n - 1) * n));
  double cosine = 0.0;
  for (int n = 18; n >= 2; n -= 2) cosine = (1.0 + cosine) * (-r2 / ((n - 1) * n));
  return add_quarters<double>({r * (1.0 + sine), 1.0 + cosine}, static_cast<std::int64_t>(quarter));
}

double value_noise(std::uint64_t seed, std::uint32_t channel, double x) {
  const double cell = std::floor(x);
  const auto lattice = [&](std::int64_t i) {
    PortableRng rng(seed + 0x632be59bd9b4e019u * (static_cast<std::uint64_t>(i) + 1) +
                    0xd1342543de82ef95u * (channel + 1));
    return rng.uniform(-1.0, 1.0);
  };
  const auto i = static_cast<std::int64_t>(cell);
  const double from = lattice(i);
  return from + (lattice(i + 1) - from) * minimum_jerk(x - cell);
}

}  // namespace catgs

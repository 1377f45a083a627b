#pragma once

#include <bit>
#include <cassert>
#include <cmath>
#include <cstdint>

#include "render_core/base/portable.h"

// Functions with the same bits on every machine. They use only the operations that IEEE 754 rounds
// exactly (+ - * / sqrt floor). The C library's sin, exp and pow differ in the last bit between
// versions and processors, and a scene is identified by its hash. The library is compiled with
// -ffp-contract=off for the same reason.
namespace catgs::synth {

using SinCos = catgs::SinCos<float>;

/// Sine and cosine of an angle in turns (1 = 360 degrees), error below 2e-6.
inline SinCos sin_cos_turns(float turns) {
  const float quarters = std::floor(turns * 4.0f + 0.5f);
  const float x = (turns - quarters * 0.25f) * 6.28318530718f;  // in [-pi/4, pi/4]
  const float x2 = x * x;
  const float s = x * (1.0f + x2 * (-1.6666667e-1f + x2 * (8.3333310e-3f + x2 * -1.9839290e-4f)));
  const float c =
      1.0f + x2 * (-0.5f + x2 * (4.1666668e-2f + x2 * (-1.3888397e-3f + x2 * 2.4760495e-5f)));
  return add_quarters<float>({s, c}, static_cast<std::int64_t>(quarters));
}

/// e^x for |x| <= 80, relative error below 8e-6.
inline float exp_exact(float x) {
  assert(x >= -80.0f && x <= 80.0f);
  const float y = x * 1.44269504f;
  const float whole = std::floor(y + 0.5f);
  const float f = (y - whole) * 0.69314718f;  // |f| <= ln(2) / 2: six Taylor terms suffice
  const float p =
      1.0f +
      f * (1.0f + f * (0.5f + f * (1.6666667e-1f +
                                   f * (4.1666667e-2f + f * (8.3333333e-3f + f * 1.3888889e-3f)))));
  const auto exponent = static_cast<std::uint32_t>(static_cast<std::int32_t>(whole) + 127) << 23;
  return p * std::bit_cast<float>(exponent);
}

inline float clamp01(float x) { return x < 0.0f ? 0.0f : (x > 1.0f ? 1.0f : x); }

/// 0 below `low`, 1 above `high`, a cubic between; `low` > `high` reverses it.
inline float smooth_step(float low, float high, float x) {
  const float t = clamp01((x - low) / (high - low));
  return t * t * (3.0f - 2.0f * t);
}

template <typename T>
T blend(const T& a, const T& b, float t) {
  return a + (b - a) * t;
}

}  // namespace catgs::synth

#include "render_core/synth/exact_math.h"

#include <cmath>

#include <gtest/gtest.h>

#include "render_core/synth/random.h"

namespace catgs::synth {
namespace {

TEST(ExactMath, SineAndCosineMatchTheLibrary) {
  for (int i = -3000; i <= 3000; ++i) {
    const float turns = static_cast<float>(i) / 997.0f;
    const SinCos value = sin_cos_turns(turns);
    const double angle = 6.283185307179586 * turns;
    EXPECT_NEAR(value.sin, std::sin(angle), 2e-6) << turns;
    EXPECT_NEAR(value.cos, std::cos(angle), 2e-6) << turns;
  }
}

TEST(ExactMath, ExponentialMatchesTheLibrary) {
  for (int i = -800; i <= 800; ++i) {
    const float x = static_cast<float>(i) / 10.0f;
    EXPECT_NEAR(exp_exact(x) / std::exp(static_cast<double>(x)), 1.0, 8e-6) << x;
  }
}

TEST(ExactMath, SmoothStepRisesFromEdgeToEdge) {
  EXPECT_EQ(smooth_step(2.0f, 4.0f, 1.0f), 0.0f);
  EXPECT_EQ(smooth_step(2.0f, 4.0f, 3.0f), 0.5f);
  EXPECT_EQ(smooth_step(2.0f, 4.0f, 5.0f), 1.0f);
  EXPECT_EQ(smooth_step(4.0f, 2.0f, 5.0f), 0.0f);
}

TEST(Random, DrawsArePureFunctionsOfKeyAndCounter) {
  Random a(42), b(42), c(43);
  EXPECT_EQ(a.bits(), 0xbdd732262feb6e95ull);  // SplitMix64 of seed 42
  b.bits();
  EXPECT_EQ(a.bits(), b.bits());
  EXPECT_NE(a.bits(), c.bits());
}

TEST(Random, HasTheMomentsItClaims) {
  Random random(7);
  constexpr int n = 200'000;
  double sum_u = 0, sum_n = 0, square_n = 0;
  int low = 0;
  for (int i = 0; i < n; ++i) {
    const float u = random.uniform();
    ASSERT_GE(u, 0.0f);
    ASSERT_LT(u, 1.0f);
    const double x = random.normal();
    sum_u += u;
    sum_n += x;
    square_n += x * x;
    low += random.below(3) == 0;
  }
  EXPECT_NEAR(sum_u / n, 0.5, 0.003);
  EXPECT_NEAR(sum_n / n, 0.0, 0.01);
  EXPECT_NEAR(square_n / n, 1.0, 0.01);
  EXPECT_NEAR(static_cast<double>(low) / n, 1.0 / 3.0, 0.005);
}

}  // namespace
}  // namespace catgs::synth

// A share of a Gaussian's opacity.

#include <cmath>

#include <gtest/gtest.h>

#include "render_core/math/constants.h"
#include "render_core/math/fade-inl.h"
#include "tests/support/random_source.h"

namespace catgs {
namespace {

// Two shares together hide what all of it hides.
TEST(FadedOpacity, SharesHideAsMuchAsAll) {
  test::RandomSource random(3);
  for (int trial = 0; trial < 1000; ++trial) {
    const double opacity = random.uniform(0.02, alpha_max), share = random.uniform(0.01, 0.99);
    const double one = std::exp2(math::faded_log2_opacity(std::log2(opacity), share));
    const double other = std::exp2(math::faded_log2_opacity(std::log2(opacity), 1.0 - share));
    EXPECT_NEAR((1.0 - one) * (1.0 - other), 1.0 - opacity, 1e-12);
    EXPECT_LT(one, opacity);
  }
}

TEST(FadedOpacity, FloatIsNearDouble) {
  test::RandomSource random(4);
  for (int trial = 0; trial < 1000; ++trial) {
    const double log2_opacity = random.uniform(log2_alpha_min, 0.0),
                 share = random.uniform(0.01, 0.99);
    EXPECT_NEAR(std::exp2(math::faded_log2_opacity(static_cast<float>(log2_opacity),
                                                   static_cast<float>(share))),
                std::exp2(math::faded_log2_opacity(log2_opacity, share)), 1e-5);
  }
}

TEST(FadedOpacity, TheInvisibleStaysInvisible) {
  for (const float log2_opacity : {-8.0f, -1e30f, -std::numeric_limits<float>::infinity()})
    EXPECT_EQ(math::faded_log2_opacity(log2_opacity, 0.5f), log2_opacity);
}

}  // namespace
}  // namespace catgs

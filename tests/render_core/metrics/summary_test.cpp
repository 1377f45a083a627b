#include "render_core/metrics/summary.h"

#include <numeric>

#include <gtest/gtest.h>

namespace catgs {
namespace {

TEST(Summary, UsesNearestRanks) {
  std::vector<double> values(100);
  std::iota(values.rbegin(), values.rend(), 1.0);  // 100 … 1
  const Summary summary = summarize(values);
  EXPECT_EQ(summary.count, 100u);
  EXPECT_DOUBLE_EQ(summary.mean, 50.5);
  EXPECT_EQ(summary.p50, 50.0);
  EXPECT_EQ(summary.p95, 95.0);
  EXPECT_EQ(summary.p99, 99.0);
  EXPECT_EQ(summary.max, 100.0);
}

TEST(Summary, OneValueAndNoneAreSummarised) {
  const Summary one = summarize({3.0});
  EXPECT_EQ(one.p50, 3.0);
  EXPECT_EQ(one.p99, 3.0);
  const Summary none = summarize({});
  EXPECT_EQ(none.count, 0u);
  EXPECT_EQ(none.max, 0.0);
  EXPECT_EQ(percentile({}, 0.5), 0.0);
}

TEST(Flatness, IgnoresASlowRiseAndSeesASpike) {
  std::vector<double> frame_ms(1000);
  for (std::size_t i = 0; i < frame_ms.size(); ++i) {
    frame_ms[i] = 1.0 + 0.01 * static_cast<double>(i);  // 1 … 11 ms
  }
  EXPECT_LT(flatness(frame_ms), 1.25);
  for (std::size_t i = 0; i < frame_ms.size(); i += 50) frame_ms[i] *= 3.0;
  EXPECT_GT(flatness(frame_ms), 2.5);
}

TEST(Flatness, EqualFramesGiveOne) {
  EXPECT_DOUBLE_EQ(flatness(std::vector<double>(7, 4.2)), 1.0);
  EXPECT_DOUBLE_EQ(flatness({}), 0.0);
}

}  // namespace
}  // namespace catgs

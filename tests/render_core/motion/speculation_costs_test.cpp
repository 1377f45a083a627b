#include "render_core/motion/speculation_costs.h"

#include <gtest/gtest.h>

namespace catgs {
namespace {

constexpr double exact_cost = 1.0;

/// A View whose groups hold `subs` sub-frames, though key frames promise four.
class SpeculationCostsTest : public testing::Test {
 protected:
  struct Run {
    int exact = 0, frames = 0;
    double cost = 0.0;

    [[nodiscard]] double mean() const { return cost / frames; }
  };

  Run draw(int frames, int subs, double key_cost, double sub_cost) {
    Run run;
    int left = 0;  // sub-frames of the group
    while (run.frames < frames) {
      double cost = exact_cost;
      if (!costs.pays()) {
        left = 0;
        ++run.exact;
        costs.note(FrameKind::key, 0, cost);
      } else if (left > 0) {
        --left;
        costs.note(FrameKind::sub, 4, cost = sub_cost);
      } else {
        left = subs;
        costs.note(FrameKind::key, 4, cost = key_cost);
      }
      ++run.frames;
      run.cost += cost;
    }
    return run;
  }

  SpeculationCosts costs;
};

TEST_F(SpeculationCostsTest, GroupsThatPayAreInterruptedOnlyToAskWhatAnExactFrameCosts) {
  const Run run = draw(2000, 4, 1.3, 0.7);  // 0.82 a frame
  EXPECT_GE(run.exact, 5);
  EXPECT_LE(run.exact, 20);
}

TEST_F(SpeculationCostsTest, GroupsThatCostMoreAreGivenUp) {
  draw(500, 1, 1.6, 0.7);  // 1.15 a frame
  const Run run = draw(2000, 1, 1.6, 0.7);
  EXPECT_LT(run.mean(), 1.02 * exact_cost);
  EXPECT_LT(run.exact, run.frames) << "it is tried again";
}

TEST_F(SpeculationCostsTest, ComeBackWhenTheyPayAgain) {
  draw(1000, 1, 1.6, 0.7);
  draw(600, 4, 1.3, 0.7);
  EXPECT_LT(draw(1000, 4, 1.3, 0.7).mean(), 0.84 * exact_cost);
}

TEST_F(SpeculationCostsTest, WithoutWindowsThereIsNothingToGiveUp) {
  for (int i = 0; i < 1000; ++i) {
    costs.note(FrameKind::key, 0, exact_cost);
    ASSERT_TRUE(costs.pays());
  }
}

TEST_F(SpeculationCostsTest, CostsThatOnlyVaryAreNoReason) {
  EXPECT_LE(draw(2000, 4, 1.3, 0.935).exact, 20);  // 1.008 a frame
}

}  // namespace
}  // namespace catgs

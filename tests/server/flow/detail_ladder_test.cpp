#include "server/flow/detail_ladder.h"

#include "tests/support/test.h"

namespace catgs {
namespace {

constexpr auto interval = 16ms;

struct Drawing {
  DetailLadder ladder{0.5f};
  TimePoint now = TimePoint{} + 1h;

  /// Frames that take so long to render, for a time.
  float draw(std::chrono::milliseconds render, std::chrono::milliseconds time) {
    for (const TimePoint end = now + time; now < end; now += interval)
      ladder.update(render, interval, now);
    return ladder.detail_px();
  }
};

TEST(DetailLadder, FallsWhileFramesTakeTooLong) {
  Drawing drawing;
  EXPECT_EQ(drawing.draw(8ms, 10s), 0.5f);
  EXPECT_EQ(drawing.draw(15ms, 900ms), 0.5f) << "a moment is not enough";
  EXPECT_EQ(drawing.draw(15ms, 500ms), 1.0f);
  EXPECT_EQ(drawing.draw(15ms, 5s), 2.0f);
}

TEST(DetailLadder, RisesWhereThereIsTime) {
  Drawing drawing;
  EXPECT_EQ(drawing.draw(15ms, 5s), 2.0f);
  EXPECT_EQ(drawing.draw(8ms, 20s), 2.0f) << "twice as much would not fit";
  EXPECT_EQ(drawing.draw(3ms, 2s), 2.0f);
  EXPECT_EQ(drawing.draw(3ms, 2s), 1.0f);
  EXPECT_EQ(drawing.draw(3ms, 4s), 0.5f);
}

TEST(DetailLadder, TheOperatorsDetailIsTheFinest) {
  Drawing coarse{.ladder = DetailLadder(1.5f)};
  EXPECT_EQ(coarse.draw(15ms, 5s), 2.0f);
  Drawing coarsest{.ladder = DetailLadder(4.0f)};
  EXPECT_EQ(coarsest.draw(15ms, 5s), 4.0f);
  Drawing all{.ladder = DetailLadder(0.0f)};
  EXPECT_EQ(all.draw(15ms, 5s), 0.0f) << "0 draws every Gaussian, whatever that costs";
}

}  // namespace
}  // namespace catgs

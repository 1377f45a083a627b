#include "server/flow/quality_ladder.h"

#include "tests/support/test.h"

namespace catgs {
namespace {

constexpr QualityLadder::Supply plenty{1e9, 1e12, false};
constexpr QualityLadder::Supply little{1e3, 1e12, false};

struct Climber {
  QualityLadder ladder{{1280, 720}, 60};
  TimePoint now = TimePoint{} + 1h;

  /// Until the rung changes, at most so long; how long it took.
  std::chrono::milliseconds wait(const QualityLadder::Supply& supply,
                                 std::chrono::milliseconds most = 100s) {
    const TimePoint start = now;
    while (now - start < most) {
      now += 250ms;
      if (ladder.update(supply, now)) break;
    }
    return std::chrono::duration_cast<std::chrono::milliseconds>(now - start);
  }
};

TEST(QualityLadder, SizeFallsBeforeTheFrameRate) {
  Climber climber;
  const std::vector<Rung> rungs = {{1.0, 1.0}, {0.75, 1.0}, {0.5, 1.0}, {0.5, 0.5}, {0.5, 0.25}};
  for (const Rung& rung : rungs) {
    EXPECT_EQ(climber.ladder.rung(), rung);
    climber.wait(little, 3s);
  }
  EXPECT_EQ(climber.ladder.rung(), rungs.back()) << "there is nothing below";
  for (auto rung = rungs.rbegin(); rung != rungs.rend(); ++rung) {
    EXPECT_EQ(climber.ladder.rung(), *rung);
    climber.wait(plenty);
  }
}

TEST(QualityLadder, SmallPicturesAndRatesHaveNoRungsBelow) {
  QualityLadder ladder({160, 90}, 5);
  for (int i = 1; i < 100; ++i) EXPECT_FALSE(ladder.update(little, TimePoint{} + 1h + i * 250ms));
}

TEST(QualityLadder, AMomentOfWantIsNotEnough) {
  Climber climber;
  for (int i = 0; i < 20; ++i) {
    climber.wait(little, 750ms);
    climber.wait(plenty, 250ms);
  }
  EXPECT_EQ(climber.ladder.steps_down(), 0u);
}

TEST(QualityLadder, WaitsLongerForARungThatDidNotHold) {
  Climber climber;
  climber.wait(little);
  auto patience = climber.wait(plenty);
  EXPECT_LT(patience, 4s);
  for (int i = 0; i < 3; ++i) {
    climber.wait(little);
    const auto next = climber.wait(plenty);
    EXPECT_GE(next, 2 * patience - 500ms);
    patience = next;
  }
  climber.wait(plenty, 20s);  // this time it holds
  climber.wait(little);
  EXPECT_LT(climber.wait(plenty), 4s);
}

TEST(QualityLadder, ADecoderThatCannotKeepUpGetsSmallerPictures) {
  Climber climber;
  const double pixels_per_s = 1280.0 * 720.0 * 30.0;
  climber.wait({1e9, pixels_per_s, false}, 3s);
  EXPECT_EQ(climber.ladder.rung(), (Rung{0.75, 1.0}));
  EXPECT_EQ(climber.wait({1e9, pixels_per_s, false}, 20s), 20s);
}

TEST(QualityLadder, BitsThatNobodyNeedsAreEnough) {
  Climber climber;
  climber.wait({1.3e6, 1e12, false}, 3s);
  EXPECT_EQ(climber.ladder.rung(), (Rung{0.75, 1.0}));
  EXPECT_EQ(climber.wait({1.3e6, 1e12, false}, 20s), 20s);
  climber.wait({1.3e6, 1e12, true});
  EXPECT_EQ(climber.ladder.steps_down(), 0u);
}

}  // namespace
}  // namespace catgs

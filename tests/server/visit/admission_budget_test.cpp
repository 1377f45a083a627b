#include "server/visit/admission_budget.h"

#include "tests/support/test.h"

namespace catgs {
namespace {

using FrameCost = SessionUsage::FrameCost;

SessionDemand session(double cpu_s, double gpu_s = 0.0, double megapixels = 1.0, int fps = 60) {
  return {FrameCost{cpu_s, gpu_s}, megapixels, fps};
}
SessionDemand unknown(double megapixels = 1.0, int fps = 60) {
  return {std::nullopt, megapixels, fps};
}
SessionDemand fresh() { return {std::nullopt, 1.0, 60, true}; }

constexpr double least = 320 * 180e-6;

TEST(AdmissionBudget, AdmitsWhileTheProcessorsKeepTheRate) {
  const AdmissionBudget budget({.cpus = 2}, 10);
  std::vector<SessionDemand> present;
  // 0.04 s x 10 Hz: five sessions fill two processors.
  for (int i = 0; i < 4; ++i) {
    present.push_back(session(0.04, 0.0, least));
    EXPECT_EQ(budget.offer(present, unknown(least)).room, Room::yes) << i;
  }
  present.push_back(session(0.04, 0.0, least));
  EXPECT_EQ(budget.offer(present, unknown(least)).room, Room::no);
  EXPECT_EQ(budget.offer(present, unknown(8.0)).room, Room::no);
}

TEST(AdmissionBudget, TheFirstSessionAlwaysFindsRoom) {
  const AdmissionBudget budget({.cpus = 1}, 60);
  EXPECT_EQ(budget.offer({}, unknown(8.0)).room, Room::yes);
  EXPECT_EQ(budget.offer(std::vector{session(1.0, 0.0, least)}, unknown()).room, Room::no);
}

TEST(AdmissionBudget, JudgesNewcomersByTheirPixelsAndRate) {
  const AdmissionBudget budget({.cpus = 1}, 10);
  const std::vector present{session(0.05)};  // half the processor
  EXPECT_EQ(budget.offer(present, unknown(1.0)).pixel_share, 1.0);
  EXPECT_LT(budget.offer(present, unknown(1.1)).pixel_share, 1.0);
  EXPECT_EQ(budget.offer(present, unknown(2.5, 5)).pixel_share, 1.0)
      << "half the rate, twice the work";
  EXPECT_EQ(budget.offer(present, unknown(2.6, 4)).pixel_share, 1.0);
  EXPECT_LT(budget.offer(present, unknown(2.6, 5)).pixel_share, 1.0);
}

TEST(AdmissionBudget, CountsThoseNotMeasuredYet) {
  const AdmissionBudget budget({.cpus = 1}, 10);
  EXPECT_EQ(budget.offer(std::vector{unknown(), unknown(), unknown()}, unknown()).room, Room::yes)
      << "nothing is known";
  EXPECT_LT(budget.offer(std::vector{session(0.04), unknown()}, unknown()).pixel_share, 1.0);
  EXPECT_EQ(budget.offer(std::vector{session(0.05, 0, least), unknown(least)}, unknown()).room,
            Room::no);
}

TEST(AdmissionBudget, ARequestForManyPixelsKeepsNobodyOut) {
  const AdmissionBudget budget({.cpus = 2}, 10);
  const std::vector present{session(0.02, 0.0, 0.004)};
  for (const double megapixels : {0.3, 2.0, 8.3, 33.0}) {
    const auto offer = budget.offer(present, unknown(megapixels, 240));
    EXPECT_EQ(offer.room, Room::yes) << megapixels;
    EXPECT_LE(offer.pixel_share * megapixels, 8.3);
    EXPECT_TRUE(offer.kept.empty()) << "the one who is there keeps its size";
    std::vector<SessionDemand> all = present;
    all.push_back(unknown(offer.pixel_share * megapixels, 240));
    EXPECT_LE(budget.load(all).fullest(), 1.0) << megapixels;
  }
}

TEST(AdmissionBudget, WhoeverTakesMoreThanAnEqualShareMakesRoom) {
  const AdmissionBudget budget({.cpus = 2}, 10);
  const std::vector present{session(0.03, 0.0, 0.23), session(0.30, 0.0, 8.3)};
  const auto offer = budget.offer(present, unknown(0.23));
  ASSERT_EQ(offer.room, Room::yes);
  ASSERT_EQ(offer.kept.size(), 2u);
  EXPECT_EQ(offer.kept[0], 1.0) << "it takes 0.15 of all, less than a third";
  EXPECT_LT(offer.kept[1], 1.0);
  EXPECT_GT(offer.kept[1], 0.3) << "no more than is needed";
}

TEST(AdmissionBudget, NobodyIsReducedInVain) {
  const AdmissionBudget budget({.cpus = 1}, 10);
  // The small one alone is more than the machine does.
  const std::vector present{session(0.2, 0.0, least), session(0.2, 0.0, 1.0)};
  const auto offer = budget.offer(present, unknown());
  EXPECT_EQ(offer.room, Room::no);
  EXPECT_TRUE(offer.kept.empty());
}

TEST(AdmissionBudget, PixelsComeBackWhereThereIsRoom) {
  const AdmissionBudget budget({.cpus = 2}, 10);
  std::vector<SessionDemand> present{session(0.02), session(0.02), session(0.02)};
  EXPECT_FALSE(budget.growth(present)) << "all have what they request";
  present[0].pixel_share = 0.25;
  present[1].pixel_share = 0.8;
  present[1].megapixels = 0.9;
  const auto growth = budget.growth(present);
  ASSERT_TRUE(growth);
  EXPECT_EQ(growth->session, 1u) << "the smaller picture first";
  EXPECT_EQ(growth->pixel_share, 1.0);
  present[2].frame_cost->cpu_seconds = 0.15;
  EXPECT_FALSE(budget.growth(present)) << "the machine is nearly full";
  EXPECT_TRUE(budget.growth(std::span(present).first(1))) << "alone it has what it requests";
}

TEST(AdmissionBudget, ABurstWaitsForWhatTheFirstOnesCost) {
  const AdmissionBudget processors({.cpus = 2}, 10);
  EXPECT_EQ(processors.offer(std::vector{fresh()}, unknown()).room, Room::yes);
  EXPECT_EQ(processors.offer(std::vector{fresh(), fresh()}, unknown()).room, Room::unknown);
  EXPECT_EQ(processors.offer(std::vector{fresh(), unknown()}, unknown()).room, Room::yes)
      << "one that is at rest";
  EXPECT_EQ(processors.offer(std::vector{fresh(), session(0.01)}, unknown()).room, Room::yes);
  const AdmissionBudget gpu({.cpus = 16, .gpus = 1}, 10);
  EXPECT_EQ(gpu.offer(std::vector{fresh()}, unknown()).room, Room::unknown);
  EXPECT_EQ(gpu.offer(std::vector{session(0.01, 0.01)}, unknown()).room, Room::yes);
  const AdmissionBudget any({.cpus = 1}, 0);
  EXPECT_EQ(any.offer(std::vector{fresh(), fresh()}, unknown()).room, Room::yes);
}

TEST(AdmissionBudget, TheScarcerOfProcessorsAndGpusDecides) {
  const AdmissionBudget budget({.cpus = 16, .gpus = 1}, 10);
  const auto one = [&](double cpu_s, double gpu_s) {
    return budget.offer(std::vector{session(cpu_s, gpu_s, least)}, unknown(least)).room;
  };
  EXPECT_EQ(one(0.001, 0.04), Room::yes);
  EXPECT_EQ(one(0.001, 0.06), Room::no);
  EXPECT_EQ(one(0.9, 0.001), Room::no);
}

TEST(AdmissionBudget, CanBeSwitchedOff) {
  const AdmissionBudget budget({.cpus = 1}, 0);
  EXPECT_EQ(budget.offer(std::vector{session(100.0)}, unknown()).room, Room::yes);
  EXPECT_EQ(budget.seats(std::vector{session(100.0)}, 16), 16);
}

TEST(AdmissionBudget, TellsHowMuchIsTakenAndHowManyFit) {
  AdmissionBudget budget({.cpus = 2, .gpus = 1}, 10);
  const std::vector present{session(0.04, 0.01), session(0.04, 0.01)};
  EXPECT_NEAR(budget.load(present).cpus, 0.4, 1e-9);
  EXPECT_NEAR(budget.load(present).gpus, 0.2, 1e-9);
  EXPECT_EQ(budget.seats(present, 16), 5);
  EXPECT_EQ(budget.seats(present, 4), 4);
  EXPECT_EQ(budget.seats({}, 16), 16);
  EXPECT_EQ(budget.seats(std::vector{unknown()}, 16), 16) << "nothing is measured yet";
  EXPECT_EQ(budget.seats(std::vector{session(9.0)}, 16), 1) << "the first is always admitted";
  budget.set_cpus(0.5);
  EXPECT_NEAR(budget.load(present).cpus, 1.6, 1e-9);
  EXPECT_EQ(budget.seats(present, 16), 1);
}

}  // namespace
}  // namespace catgs

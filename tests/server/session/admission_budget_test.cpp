#include "server/session/admission_budget.h"

#include <vector>

#include <gtest/gtest.h>

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

TEST(AdmissionBudget, AdmitsWhileTheProcessorsKeepTheRate) {
  const AdmissionBudget budget({.cpus = 2}, 10);
  std::vector<SessionDemand> present;
  // 0.04 s x 10 Hz: five sessions fill two processors.
  for (int i = 0; i < 4; ++i) {
    present.push_back(session(0.04));
    EXPECT_EQ(budget.room(present, unknown()), Room::yes) << i;
  }
  present.push_back(session(0.04));
  EXPECT_EQ(budget.room(present, unknown()), Room::no);
  EXPECT_EQ(budget.room(present, unknown(0.01)), Room::no);
}

TEST(AdmissionBudget, TheFirstSessionAlwaysFindsRoom) {
  const AdmissionBudget budget({.cpus = 1}, 60);
  EXPECT_EQ(budget.room({}, unknown(8.0)), Room::yes);
  EXPECT_EQ(budget.room(std::vector{session(1.0)}, unknown()), Room::no);
}

TEST(AdmissionBudget, JudgesNewcomersByTheirPixelsAndRate) {
  const AdmissionBudget budget({.cpus = 1}, 10);
  const std::vector present{session(0.05)};  // half the processor
  EXPECT_EQ(budget.room(present, unknown(1.0)), Room::yes);
  EXPECT_EQ(budget.room(present, unknown(1.1)), Room::no);
  EXPECT_EQ(budget.room(present, unknown(2.0, 5)), Room::yes) << "who wants less gets in";
}

TEST(AdmissionBudget, CountsThoseNotMeasuredYet) {
  const AdmissionBudget budget({.cpus = 1}, 10);
  EXPECT_EQ(budget.room(std::vector{unknown(), unknown(), unknown()}, unknown()), Room::yes)
      << "nothing is known";
  EXPECT_EQ(budget.room(std::vector{session(0.05), unknown()}, unknown()), Room::no);
}

TEST(AdmissionBudget, ABurstWaitsForWhatTheFirstOnesCost) {
  const AdmissionBudget processors({.cpus = 2}, 10);
  EXPECT_EQ(processors.room(std::vector{fresh()}, unknown()), Room::yes);
  EXPECT_EQ(processors.room(std::vector{fresh(), fresh()}, unknown()), Room::unknown);
  EXPECT_EQ(processors.room(std::vector{fresh(), unknown()}, unknown()), Room::yes)
      << "one that is at rest";
  EXPECT_EQ(processors.room(std::vector{fresh(), session(0.01)}, unknown()), Room::yes);
  const AdmissionBudget gpu({.cpus = 16, .gpus = 1}, 10);
  EXPECT_EQ(gpu.room(std::vector{fresh()}, unknown()), Room::unknown);
  EXPECT_EQ(gpu.room(std::vector{session(0.01, 0.01)}, unknown()), Room::yes);
  const AdmissionBudget any({.cpus = 1}, 0);
  EXPECT_EQ(any.room(std::vector{fresh(), fresh()}, unknown()), Room::yes);
}

TEST(AdmissionBudget, TheScarcerOfProcessorsAndGpusDecides) {
  const AdmissionBudget budget({.cpus = 16, .gpus = 1}, 10);
  EXPECT_EQ(budget.room(std::vector{session(0.001, 0.04)}, unknown()), Room::yes);
  EXPECT_EQ(budget.room(std::vector{session(0.001, 0.06)}, unknown()), Room::no);
  EXPECT_EQ(budget.room(std::vector{session(0.9, 0.001)}, unknown()), Room::no);
}

TEST(AdmissionBudget, CanBeSwitchedOff) {
  const AdmissionBudget budget({.cpus = 1}, 0);
  EXPECT_EQ(budget.room(std::vector{session(100.0)}, unknown()), Room::yes);
  EXPECT_EQ(budget.seats(std::vector{session(100.0)}, 16), 16);
}

TEST(AdmissionBudget, TellsHowMuchIsTakenAndHowManyFit) {
  const AdmissionBudget budget({.cpus = 2, .gpus = 1}, 10);
  const std::vector present{session(0.04, 0.01), session(0.04, 0.01)};
  EXPECT_NEAR(budget.load(present).cpus, 0.4, 1e-9);
  EXPECT_NEAR(budget.load(present).gpus, 0.2, 1e-9);
  EXPECT_EQ(budget.seats(present, 16), 5);
  EXPECT_EQ(budget.seats(present, 4), 4);
  EXPECT_EQ(budget.seats({}, 16), 16);
  EXPECT_EQ(budget.seats(std::vector{unknown()}, 16), 16) << "nothing is measured yet";
  EXPECT_EQ(budget.seats(std::vector{session(9.0)}, 16), 1) << "the first is always admitted";
}

}  // namespace
}  // namespace catgs

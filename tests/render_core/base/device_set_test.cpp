#include "render_core/base/device_set.h"

#include <optional>
#include <stdexcept>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/refusal.h"

namespace catgs {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using testing::Pair;

TEST(DeviceSet, SlotsAreTakenWhereTheFewestAre) {
  const auto set = std::make_shared<DeviceSet>(std::vector<int>{});
  const std::vector<int> devices = {2, 0, 5};
  std::vector<std::optional<DeviceSet::Slot>> slots;
  std::vector<int> taken;
  for (int i = 0; i < 7; ++i) {
    slots.emplace_back(set->take(devices));
    taken.push_back(slots.back()->device());
  }
  EXPECT_THAT(taken, ElementsAre(2, 0, 5, 2, 0, 5, 2));
  EXPECT_THAT(set->views(), ElementsAre(Pair(0, 2), Pair(2, 3), Pair(5, 2)));

  slots[1].reset();
  slots[4].reset();  // device 0 is empty
  EXPECT_EQ(set->take(devices).device(), 0);
  EXPECT_THAT(set->views(), ElementsAre(Pair(0, 0), Pair(2, 3), Pair(5, 2)));
}

TEST(DeviceSet, RenderersOfSomeDevicesSeeTheViewsOfOthers) {
  const auto set = std::make_shared<DeviceSet>(std::vector<int>{});
  const std::vector<int> both = {0, 1}, second = {1};
  const auto a = set->take(second), b = set->take(both), c = set->take(second), d = set->take(both);
  EXPECT_EQ(b.device(), 0);
  EXPECT_EQ(d.device(), 0);
}

TEST(DeviceSet, SlotsAreTakenWhereTheLeastWorkIsMeasured) {
  const auto set = std::make_shared<DeviceSet>(std::vector<int>{});
  const std::vector<int> devices = {0, 1};
  std::vector<DeviceSet::Slot> slots;
  const auto take = [&] {
    slots.push_back(set->take(devices));
    return slots.back().device();
  };
  for (int i = 0; i < 4; ++i) (void)take();
  set->set_loads({{0, 0.75}, {1, 0.25}});  // 0.25 a View in the mean
  EXPECT_EQ(take(), 1);
  EXPECT_EQ(take(), 1) << "0.5, with the one that nothing is known of";
  EXPECT_EQ(take(), 0) << "0.75 each: now the fewest count";
  set->set_loads({{1, 0.1}});
  EXPECT_EQ(take(), 0) << "not named: idle";
  set->set_loads({{0, 0.0}, {1, 0.0}});
  EXPECT_EQ(take(), 0);
  EXPECT_EQ(take(), 1) << "nobody works: the fewest, in turn";
}

TEST(DeviceSet, UnmeasuredCostsAreForgottenWithTheirView) {
  const auto set = std::make_shared<DeviceSet>(std::vector<int>{});
  const std::vector<int> devices = {0, 1};
  const auto a = set->take(devices);
  const auto b = set->take(devices);
  set->set_loads({{0, 0.5}, {1, 0.4}});
  for (int i = 0; i < 9; ++i) EXPECT_EQ(set->take(devices).device(), 1) << "each has left again";
}

TEST(DeviceSet, ASlotOutlivesItsSetAndMovesWithItsView) {
  auto set = std::make_shared<DeviceSet>();
  const std::vector<int> devices = {0};
  std::optional<DeviceSet::Slot> moved;
  {
    DeviceSet::Slot slot = set->take(devices);
    moved.emplace(std::move(slot));
  }
  EXPECT_THAT(set->views(), ElementsAre(Pair(0, 1)));
  const std::weak_ptr<DeviceSet> watched = set;
  set.reset();
  EXPECT_FALSE(watched.expired());
  moved.reset();
  EXPECT_TRUE(watched.expired());
}

TEST(DeviceSet, ListsDevicesWithoutViews) {
  const auto set = std::make_shared<DeviceSet>();
  EXPECT_THAT(set->views(), IsEmpty());
  const std::vector<int> devices = {3};
  const auto slot = set->take(devices);
  set->add(3);
  set->add(4);
  EXPECT_THAT(set->views(), ElementsAre(Pair(3, 1), Pair(4, 0)));
}

TEST(DeviceSet, EveryThreadGivesBackWhatItTook) {
  const auto set = std::make_shared<DeviceSet>(std::vector<int>{});
  const std::vector<int> devices = {0, 1};
  std::vector<DeviceSet::Slot> kept;
  kept.push_back(set->take(devices));
  {
    std::vector<std::jthread> threads;
    for (int t = 0; t < 4; ++t) {
      threads.emplace_back([&] {
        for (int i = 0; i < 1000; ++i) {
          const auto first = set->take(devices), second = set->take(devices);
        }
      });
    }
  }
  EXPECT_THAT(set->views(), ElementsAre(Pair(0, 1), Pair(1, 0)));
}

TEST(DeviceSet, KnowsWhichDevicesAreMissing) {
  EXPECT_THAT(DeviceSet().among(2), ElementsAre(0));
  EXPECT_THAT(DeviceSet({3, 1}).among(4), ElementsAre(3, 1));
  EXPECT_THAT(DeviceSet(std::vector<int>{}).among(3), ElementsAre(0, 1, 2));
  const auto refusal = [](const DeviceSet& set, int count) {
    return test::input_error([&] { (void)set.among(count); });
  };
  EXPECT_EQ(refusal(DeviceSet({0, 2}), 2),
            "--device 0,2: there is no CUDA device 2 (devices 0 to 1 are here)");
  EXPECT_EQ(refusal(DeviceSet({1}), 1),
            "--device 1: there is no CUDA device 1 (device 0 is the only one here)");
}

TEST(Devices, AreAllOrAList) {
  EXPECT_THAT(parse_devices("all"), IsEmpty());
  EXPECT_THAT(parse_devices("0"), ElementsAre(0));
  EXPECT_THAT(parse_devices("3,0,12"), ElementsAre(3, 0, 12));
  for (const char* text : {"all", "0", "3,0,12"}) {
    EXPECT_EQ(devices_text(parse_devices(text)), text);
  }
  for (const char* text :
       {"", "both", "-1", "0,", ",0", "0,,1", "0 1", "1.5", "all,0", "0x1", "99999999999", "0,1,0"})
    EXPECT_THROW(parse_devices(text), std::invalid_argument) << text;
}

}  // namespace
}  // namespace catgs

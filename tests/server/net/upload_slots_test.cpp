#include "server/net/upload_slots.h"

#include "tests/support/test.h"

namespace catgs {
namespace {

using Held = std::vector<std::shared_ptr<UploadSlot>>;

TEST(UploadSlots, AreAFewAndFreeAgainWhenNobodyHoldsThem) {
  UploadSlots places(UploadSlots::small);
  Held held;
  for (std::size_t i = 0; i < UploadSlots::small.all; ++i)
    held.push_back(places.take("link " + std::to_string(i), "address " + std::to_string(i)));
  EXPECT_EQ(places.taken(), UploadSlots::small.all);
  EXPECT_EQ(places.take("one more", "elsewhere"), nullptr);
  const std::shared_ptr<const UploadSlot> saver = held.back();
  held.back()->abandon();
  held.pop_back();
  EXPECT_EQ(places.take("one more", "elsewhere"), nullptr) << "its body is still in memory";
  EXPECT_TRUE(saver->abandoned());
  held.pop_back();
  EXPECT_EQ(places.taken(), UploadSlots::small.all - 1);
  const auto place = places.take("one more", "elsewhere");
  ASSERT_TRUE(place);
  EXPECT_FALSE(place->abandoned());
}

TEST(UploadSlots, OneLinkLeavesSomeToOthers) {
  UploadSlots places(UploadSlots::small);
  Held held;
  while (auto place = places.take("greedy", std::to_string(held.size())))
    held.push_back(std::move(place));
  EXPECT_EQ(held.size(), UploadSlots::small.of_a_link);
  EXPECT_TRUE(places.take("another", "elsewhere"));
  held.pop_back();
  EXPECT_TRUE(places.take("greedy", "elsewhere"));
}

TEST(UploadSlots, OneAddressLeavesSomeToOthers) {
  for (const UploadSlots::Bounds& bounds : {UploadSlots::small, UploadSlots::large}) {
    UploadSlots places(bounds);
    Held held;
    while (auto place = places.take(std::to_string(held.size()), "greedy"))
      held.push_back(std::move(place));
    EXPECT_EQ(held.size(), bounds.of_an_address);
    EXPECT_LT(held.size(), bounds.all);
    EXPECT_TRUE(places.take("another", "elsewhere"));
  }
}

TEST(UploadSlots, LargeBodiesHaveFewer) {
  UploadSlots places(UploadSlots::large);
  const auto first = places.take("greedy", "here");
  EXPECT_TRUE(first);
  EXPECT_FALSE(places.take("greedy", "elsewhere"));
  const auto second = places.take("another", "elsewhere");
  EXPECT_TRUE(second);
  EXPECT_FALSE(places.take("one more", "far away"));
}

}  // namespace
}  // namespace catgs

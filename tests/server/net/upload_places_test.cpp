#include "server/net/upload_places.h"

#include <string>
#include <vector>

#include <gtest/gtest.h>

namespace catgs {
namespace {

TEST(UploadPlaces, AreAFewAndFreeAgainWhenNobodyHoldsThem) {
  UploadPlaces places;
  std::vector<std::shared_ptr<UploadPlace>> held;
  for (std::size_t i = 0; i < UploadPlaces::places; ++i)
    held.push_back(places.take("link " + std::to_string(i)));
  EXPECT_EQ(places.taken(), UploadPlaces::places);
  EXPECT_EQ(places.take("one more"), nullptr);
  const std::shared_ptr<const UploadPlace> saver = held.back();
  held.back()->abandon();
  held.pop_back();
  EXPECT_EQ(places.take("one more"), nullptr) << "its body is still in memory";
  EXPECT_TRUE(saver->abandoned());
  held.pop_back();
  EXPECT_EQ(places.taken(), UploadPlaces::places - 1);
  const auto place = places.take("one more");
  ASSERT_TRUE(place);
  EXPECT_FALSE(place->abandoned());
}

TEST(UploadPlaces, OneLinkLeavesSomeToOthers) {
  UploadPlaces places;
  std::vector<std::shared_ptr<UploadPlace>> held;
  while (auto place = places.take("greedy")) held.push_back(std::move(place));
  EXPECT_EQ(held.size(), UploadPlaces::places_of_a_link);
  EXPECT_TRUE(places.take("another"));
  held.pop_back();
  EXPECT_TRUE(places.take("greedy"));
}

TEST(UploadPlaces, ForLargeBodiesAreFewer) {
  UploadPlaces places(UploadPlaces::large_places, UploadPlaces::large_places_of_a_link);
  const auto first = places.take("greedy");
  EXPECT_TRUE(first);
  EXPECT_FALSE(places.take("greedy"));
  const auto second = places.take("another");
  EXPECT_TRUE(second);
  EXPECT_FALSE(places.take("one more"));
}

}  // namespace
}  // namespace catgs

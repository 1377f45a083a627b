#include "server/net/accept_gate.h"

#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

namespace catgs {
namespace {

using testing::HasSubstr;

TEST(AcceptGate, LeavesDescriptorsToTheRestOfTheServer) {
  AcceptGate gate;
  EXPECT_FALSE(gate.refusal(1024 - 64 - 1, 1024, "192.0.2.1"));
  EXPECT_THAT(gate.refusal(1024 - 64, 1024, "192.0.2.2").value_or(""),
              HasSubstr("960 descriptors are taken"));
}

TEST(AcceptGate, UsesNoMoreDescriptorsThanThereAreTablesFor) {
  EXPECT_EQ(AcceptGate::usable_descriptors(20'000), 20'000);
  EXPECT_EQ(AcceptGate::usable_descriptors(1'000'000'000), 65'536);
  EXPECT_EQ(AcceptGate::usable_descriptors(RLIM_INFINITY), 65'536);
  rlimit before{};
  ASSERT_EQ(::getrlimit(RLIMIT_NOFILE, &before), 0);
  AcceptGate::raise_descriptor_limit();
  EXPECT_EQ(AcceptGate::descriptor_limit(), AcceptGate::usable_descriptors(before.rlim_max));
  ::setrlimit(RLIMIT_NOFILE, &before);
}

TEST(AcceptGate, OneAddressHasHalfOfThemAtMost) {
  AcceptGate gate;
  const std::vector<char> connections(1200);
  const auto lets_in = [&](const std::string& address, std::size_t connection) {
    if (gate.refusal(490, 1024, address)) return false;
    gate.opened(&connections[connection]);
    return true;
  };
  for (std::size_t i = 0; i < 480; ++i) EXPECT_TRUE(lets_in("192.0.2.1", i));
  EXPECT_THAT(gate.refusal(490, 1024, "192.0.2.1").value_or(""), HasSubstr("480 are open already"));
  EXPECT_TRUE(lets_in("192.0.2.2", 480)) << "others find room";
  gate.closed(&connections[480]);
  EXPECT_FALSE(lets_in("192.0.2.1", 480));
  gate.closed(&connections[0]);
  EXPECT_TRUE(lets_in("192.0.2.1", 0));
  EXPECT_FALSE(lets_in("192.0.2.1", 480));
  for (std::size_t i = 500; i < 1200; ++i) EXPECT_TRUE(lets_in("", i)) << "of a proxy";
}

}  // namespace
}  // namespace catgs

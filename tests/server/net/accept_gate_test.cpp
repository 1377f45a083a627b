#include "server/net/accept_gate.h"

#include <sys/resource.h>

#include "tests/support/test.h"

namespace catgs {
namespace {

constexpr int descriptors = 65'536;
constexpr TimePoint start{};

/// A gate and the connections that it lets in, which are numbers here.
class Guests {
 public:
  explicit Guests(const AcceptGate::Bounds& bounds) : gate(bounds) {}

  bool lets_in(const std::string& address, std::size_t connection, TimePoint now = start) {
    why = gate.refusal(490, limit, address, now).value_or("");
    if (why.empty()) gate.opened(key(connection));
    return why.empty();
  }
  void requests(std::size_t connection) { gate.requested(key(connection)); }
  void leaves(std::size_t connection) { gate.closed(key(connection)); }

  int limit = descriptors;
  std::string why{};  // the last one was refused

 private:
  const void* key(std::size_t connection) const { return &keys.at(connection); }

  const std::vector<char> keys = std::vector<char>(2000);
  AcceptGate gate;
};

TEST(AcceptGate, LeavesDescriptorsToTheRestOfTheServer) {
  AcceptGate gate(AcceptGate::bounds_for(64));
  EXPECT_FALSE(gate.refusal(1024 - 64 - 1, 1024, "192.0.2.1", start));
  EXPECT_TRUE(gate.refusal(1024 - 64, 1024, "192.0.2.2", start));
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
  Guests guests({.open = 2000, .silent = 2000, .per_second = 0.0});
  guests.limit = 1024;
  for (std::size_t i = 0; i < 480; ++i) EXPECT_TRUE(guests.lets_in("192.0.2.1", i));
  EXPECT_FALSE(guests.lets_in("192.0.2.1", 480));
  EXPECT_THAT(guests.why, HasSubstr("480 are open already"));
  EXPECT_TRUE(guests.lets_in("192.0.2.2", 480)) << "others find room";
  guests.leaves(480);
  EXPECT_FALSE(guests.lets_in("192.0.2.1", 480));
  guests.leaves(0);
  EXPECT_TRUE(guests.lets_in("192.0.2.1", 0));
  EXPECT_FALSE(guests.lets_in("192.0.2.1", 480));
  for (std::size_t i = 500; i < 1200; ++i)
    EXPECT_TRUE(guests.lets_in("", i)) << "a proxy has no bound";
}

TEST(AcceptGate, OneAddressHasAThousandOfVeryMany) {
  AcceptGate::Bounds bounds = AcceptGate::bounds_for(64);
  bounds.silent = 2000;
  Guests guests(bounds);
  for (std::size_t i = 0; i < 1024; ++i) ASSERT_TRUE(guests.lets_in("192.0.2.1", i)) << guests.why;
  EXPECT_FALSE(guests.lets_in("192.0.2.1", 1024));
  EXPECT_TRUE(guests.lets_in("192.0.2.2", 1024));
}

TEST(AcceptGate, FewConnectionsOfAnAddressAreWithoutARequest) {
  Guests guests({.open = 100, .silent = 10, .per_second = 0.0});
  for (std::size_t i = 0; i < 10; ++i) EXPECT_TRUE(guests.lets_in("192.0.2.1", i));
  EXPECT_FALSE(guests.lets_in("192.0.2.1", 10));
  EXPECT_THAT(guests.why, HasSubstr("10 have sent no request"));
  EXPECT_TRUE(guests.lets_in("192.0.2.2", 11));
  guests.requests(0);
  guests.requests(0);
  EXPECT_TRUE(guests.lets_in("192.0.2.1", 10));
  EXPECT_FALSE(guests.lets_in("192.0.2.1", 12));
  guests.leaves(0);  // it was not silent
  EXPECT_FALSE(guests.lets_in("192.0.2.1", 12));
  guests.leaves(1);
  EXPECT_TRUE(guests.lets_in("192.0.2.1", 12));
}

TEST(AcceptGate, OneAddressConnectsInABurstAndThenAtARate) {
  Guests guests({.open = 20, .silent = 20, .per_second = 2.0});
  const auto visits = [&](TimePoint now) {
    const bool was_let_in = guests.lets_in("192.0.2.1", 0, now);
    guests.leaves(0);
    return was_let_in;
  };
  for (int i = 0; i < 20; ++i) EXPECT_TRUE(visits(start));
  EXPECT_FALSE(visits(start));
  EXPECT_THAT(guests.why, HasSubstr("more than 2 a second"));
  EXPECT_TRUE(guests.lets_in("192.0.2.2", 1));
  EXPECT_TRUE(visits(start + 1s));
  EXPECT_TRUE(visits(start + 1s));
  EXPECT_FALSE(visits(start + 1s));
  for (int i = 0; i < 20; ++i) EXPECT_TRUE(visits(start + 20s));
}

TEST(AcceptGate, ForgetsOnlyAddressesThatHaveNoConnection) {
  Guests guests({.open = 1, .silent = 1, .per_second = 0.0});
  EXPECT_TRUE(guests.lets_in("stays", 0));
  EXPECT_TRUE(guests.lets_in("goes", 1));
  guests.leaves(1);
  EXPECT_FALSE(guests.lets_in("goes", 1)) << "its burst is used up";
  for (std::size_t i = 0; i < AcceptGate::most_addresses; ++i) {
    EXPECT_TRUE(guests.lets_in(std::to_string(i), 2));
    guests.leaves(2);
  }
  EXPECT_TRUE(guests.lets_in("goes", 1));
  EXPECT_FALSE(guests.lets_in("stays", 2));
}

}  // namespace
}  // namespace catgs

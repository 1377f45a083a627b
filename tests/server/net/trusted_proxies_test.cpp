#include "server/net/trusted_proxies.h"

#include "tests/support/test.h"

namespace catgs {
namespace {

TEST(TrustedProxies, NobodyIsBelievedUnlessNamed) {
  const TrustedProxies none;
  EXPECT_EQ(none.client_address("127.0.0.1", "198.51.100.7"), "127.0.0.1");
  const TrustedProxies proxies({"10.0.0.0/8"});
  EXPECT_EQ(proxies.client_address("192.0.2.1", "198.51.100.7"), "192.0.2.1");
  EXPECT_EQ(proxies.client_address("10.1.2.3", ""), "10.1.2.3");
  EXPECT_EQ(proxies.client_address("10.1.2.3", "198.51.100.7"), "198.51.100.7");
}

TEST(TrustedProxies, AddressesMadeUpByTheClientAreIgnored) {
  const TrustedProxies proxies({"10.0.0.0/8", "192.0.2.99"});
  EXPECT_EQ(proxies.client_address("10.0.0.1", "1.1.1.1, 198.51.100.7"), "198.51.100.7");
  EXPECT_EQ(proxies.client_address("10.0.0.1", "1.1.1.1, 198.51.100.7 ,192.0.2.99, 10.0.0.2"),
            "198.51.100.7")
      << "through several proxies";
  EXPECT_EQ(proxies.client_address("10.0.0.1", "10.0.0.3"), "10.0.0.3") << "a client inside";
  EXPECT_EQ(proxies.client_address("10.0.0.1", "198.51.100.7, unknown"), "10.0.0.1");
  EXPECT_EQ(proxies.client_address("10.0.0.1", ","), "10.0.0.1");
  EXPECT_EQ(proxies.client_address("10.0.0.1", "[::1"), "::1");
  EXPECT_EQ(proxies.client_address("10.0.0.1", "["), "10.0.0.1");
}

TEST(TrustedProxies, OneSpellingForOneHost) {
  const TrustedProxies proxies({"10.0.0.0/8", "2001:db8::/32"});
  EXPECT_EQ(proxies.client_address("::ffff:192.0.2.1", ""), "192.0.2.1");
  EXPECT_EQ(proxies.client_address("::ffff:10.0.0.1", "198.51.100.7:4711"), "198.51.100.7");
  EXPECT_EQ(proxies.client_address("2001:db8::1", "[2001:0DB9:0::7]:4711"), "2001:db9::7");
  EXPECT_EQ(proxies.client_address("2001:db9::1", "198.51.100.7"), "2001:db9::1");
}

TEST(TrustedProxies, NamesWhatIsNoNetwork) {
  for (const char* text :
       {"", "proxy.example", "10.0.0.0/33", "10.0.0.0/", "::/129", "10.0.0.0/8/8"})
    EXPECT_THROW(TrustedProxies({text}), std::invalid_argument) << text;
  EXPECT_NO_THROW(TrustedProxies({"10.0.0.0/8", "10.1.2.3", "::1", "::/0"}));
}

TEST(TrustedProxies, LimitsCountNetworksOfIpv6) {
  EXPECT_EQ(limited_as("2001:db8:1:2:3:4:5:6"), "2001:db8:1:2::/64");
  EXPECT_EQ(limited_as("2001:db8:1:2::"), "2001:db8:1:2::/64");
  EXPECT_NE(limited_as("2001:db8:1:3::"), limited_as("2001:db8:1:2::"));
  EXPECT_EQ(limited_as("fe80::1%3"), "fe80::/64");
  EXPECT_EQ(limited_as("::ffff:192.0.2.1"), "192.0.2.1");
  EXPECT_EQ(limited_as("192.0.2.1"), "192.0.2.1");
  EXPECT_EQ(limited_as("unknown"), "unknown");
}

}  // namespace
}  // namespace catgs

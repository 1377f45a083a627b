#include "server/net/visitor_address.h"

#include "server/net/http.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/test.h"
#include "tests/support/tls.h"

namespace catgs::test {
namespace {

const std::vector<std::string> machine = {"192.0.2.7", "2001:db8::7"};

TEST(VisitorHost, IsWhatOtherMachinesReach) {
  EXPECT_EQ(visitor_host("127.0.0.1", "", machine), "127.0.0.1");
  EXPECT_EQ(visitor_host("::1", "", machine), "[::1]");
  EXPECT_EQ(visitor_host("192.0.2.9", "", machine), "192.0.2.9");
  EXPECT_EQ(visitor_host("0.0.0.0", "", machine), "192.0.2.7");
  EXPECT_EQ(visitor_host("::", "", {"2001:db8::7"}), "[2001:db8::7]");
  EXPECT_EQ(visitor_host("0.0.0.0", "", {}), "localhost") << "a machine without a network";
}

TEST(VisitorHost, IsOneThatTheCertificateIsFor) {
  const TemporaryFolder folder;
  const auto shown = [&](const std::string& names, const std::string& bind = "0.0.0.0") {
    const auto certificate = folder / "cert.pem";
    write_self_signed(certificate, folder / "key.pem", 1, names);
    return visitor_host(bind, certificate.string(), machine);
  };
  EXPECT_EQ(shown("DNS:*.example,DNS:localhost,DNS:tours.example"), "tours.example");
  EXPECT_EQ(shown("DNS:tours.example", "192.0.2.9"), "tours.example");
  EXPECT_EQ(shown("DNS:tours.example,IP:2001:db8::7"), "[2001:db8::7]");
  EXPECT_EQ(shown("DNS:tours.example", "127.0.0.1"), "127.0.0.1") << "a proxy is in front";
  EXPECT_EQ(shown("DNS:localhost"), "192.0.2.7") << "the browser warns, and opens it";
  EXPECT_EQ(shown(""), "192.0.2.7");
  EXPECT_EQ(visitor_host("0.0.0.0", (folder / "absent").string(), machine), "192.0.2.7");
}

TEST(VisitorHost, NoAddressOfTheMachineIsItsOwnLoopback) {
  EXPECT_THAT(machine_addresses(), Each(Truly([](const auto& a) { return !is_loopback(a); })));
}

}  // namespace
}  // namespace catgs::test

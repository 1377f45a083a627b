#include "server/net/net_server.h"
#include "tests/support/captured_log.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/test.h"

namespace catgs {
namespace {

class ListenErrorTest : public testing::Test {
 protected:
  void listen(const Endpoint& endpoint) {
    NetOptions options;
    options.listen = endpoint;
    NetServer(std::move(options), background_);
  }

  Background background_;
  const test::CapturedLog log_;
};

TEST_F(ListenErrorTest, NamesABusyPortAndWhatToDo) {
  const NetServer first({}, background_);
  const std::string endpoint = "--bind 127.0.0.1:" + std::to_string(first.port());
  EXPECT_THAT([&] { listen({.address = "127.0.0.1", .port = first.port()}); },
              ThrowsMessage<InputError>(AllOf(StartsWith(endpoint), HasSubstr("another program"),
                                              HasSubstr("choose another port"))));
  EXPECT_EQ(log_.text(), "") << "one error is enough";
}

TEST_F(ListenErrorTest, NamesFilesThatAreNoCertificateAndKey) {
  const test::TemporaryFolder folder;
  const std::string certificate = folder.write("cert.pem", "no certificate\n").string();
  const auto listen_with_them = [&] {
    NetOptions options;
    options.tls_certificate = certificate;
    options.tls_key = folder.write("key.pem", "no key\n").string();
    NetServer(std::move(options), background_);
  };
  EXPECT_THAT(listen_with_them,
              ThrowsMessage<InputError>(AllOf(HasSubstr("--tls-cert " + certificate),
                                              HasSubstr("openssl pkey -pubout -in"))));
}

TEST_F(ListenErrorTest, NamesAnAddressOfAnotherMachine) {
  // Of a block that is for documents alone (RFC 5737).
  for (const std::string address : {"192.0.2.1", "server.example"})
    EXPECT_THAT(test::refused_field([&] { listen({.address = address, .port = 0}); }),
                StartsWith("--bind " + address));
  EXPECT_EQ(log_.text(), "");
}

}  // namespace
}  // namespace catgs

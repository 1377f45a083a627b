#include <memory>
#include <sstream>
#include <string>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <spdlog/sinks/ostream_sink.h>
#include <spdlog/spdlog.h>

#include "render_core/base/error.h"
#include "server/net/net_server.h"
#include "tests/support/temporary_folder.h"

namespace catgs {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::ThrowsMessage;

/// What the log says meanwhile, from level info on.
class ListenErrorTest : public testing::Test {
 protected:
  ListenErrorTest() : before_(spdlog::default_logger()) {
    spdlog::set_default_logger(std::make_shared<spdlog::logger>(
        "test", std::make_shared<spdlog::sinks::ostream_sink_st>(log_)));
  }
  ~ListenErrorTest() override { spdlog::set_default_logger(before_); }

  static void listen(const Endpoint& endpoint) {
    NetOptions options;
    options.listen = endpoint;
    NetServer{std::move(options)};
  }

  std::ostringstream log_;

 private:
  std::shared_ptr<spdlog::logger> before_;
};

TEST_F(ListenErrorTest, NamesABusyPortAndWhatToDo) {
  NetOptions options;
  const NetServer first(std::move(options));
  EXPECT_THAT(
      [&] {
        listen({"127.0.0.1", first.port()});
      },
      ThrowsMessage<InputError>(AllOf(HasSubstr("--bind 127.0.0.1:" + std::to_string(first.port())),
                                      HasSubstr("another program"),
                                      HasSubstr("choose another port"))));
  EXPECT_EQ(log_.str(), "") << "one error is enough";
}

TEST_F(ListenErrorTest, NamesFilesThatAreNoCertificateAndKey) {
  const test::TemporaryFolder folder;
  const auto listen_with = [&](const char* certificate, const char* key) {
    NetOptions options;
    options.tls_certificate = folder.write("cert.pem", certificate).string();
    options.tls_key = folder.write("key.pem", key).string();
    NetServer{std::move(options)};
  };
  EXPECT_THAT([&] { listen_with("no certificate\n", "no key\n"); },
              ThrowsMessage<InputError>(
                  AllOf(HasSubstr("--tls-cert " + (folder / "cert.pem").string()),
                        HasSubstr("belong together"), HasSubstr("openssl pkey -pubout -in"))));
}

TEST_F(ListenErrorTest, NamesAnAddressOfAnotherMachine) {
  // Of a block that is for documents alone (RFC 5737).
  for (const char* address : {"192.0.2.1", "server.example"})
    EXPECT_THAT(
        [&] {
          listen({address, 0});
        },
        ThrowsMessage<InputError>(
            AllOf(HasSubstr(std::string("--bind ") + address), HasSubstr("no such address"))));
  EXPECT_EQ(log_.str(), "");
}

}  // namespace
}  // namespace catgs

// Integration: who is refused is told to the operator, with the address and in a counter. Real
// sockets on loopback, a whole server in this process.

#include <sstream>

#include <boost/system/system_error.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <spdlog/sinks/ostream_sink.h>
#include <spdlog/spdlog.h>

#include "tests/support/server_client.h"
#include "tests/support/temporary_folder.h"

namespace catgs::test {
namespace {

using testing::HasSubstr;

class Refusals : public testing::Test {
 protected:
  Refusals() {
    spdlog::set_default_logger(std::make_shared<spdlog::logger>(
        "refusals test", std::make_shared<spdlog::sinks::ostream_sink_mt>(log_)));
    server_.emplace([&](ServerConfig& config) {
      config.trusted_proxies = {"127.0.0.0/8"};
      config.token_key_file = folder_.write("key", std::string(32, 'k')).string();
    });
  }
  ~Refusals() override {
    server_.reset();
    spdlog::set_default_logger(before_);
  }

  double count(const std::string& name) { return metric(*server_, name); }
  /// When the server has ended.
  std::string log() {
    server_.reset();
    return log_.str();
  }

  std::optional<RunningServer> server_;

 private:
  const TemporaryFolder folder_;
  const std::shared_ptr<spdlog::logger> before_ = spdlog::default_logger();
  std::ostringstream log_;
};

TEST_F(Refusals, OfHostsOriginsAndUploadsNameTheAddressBehindTheProxy) {
  const auto from = [](int host) {
    return std::pair<const std::string, std::string>("x-forwarded-for",
                                                     "198.51.100." + std::to_string(host));
  };
  const int port = server_->port();
  EXPECT_EQ(http_get(port, "/", {{"host", "evil.example"}, from(1)}).status, 403);
  EXPECT_THROW(
      WireClient(port, {.origin = "https://evil.example", .forwarded_for = from(2).second}),
      boost::system::system_error);
  const auto put = [&](std::map<std::string, std::string> headers) {
    return http_put(port, "/api/scenes/city/sidecar", "{}", headers).status;
  };
  EXPECT_EQ(put({{"origin", "https://evil.example"}, from(3)}), 403);
  EXPECT_EQ(put({{"authorization", "Bearer open-sesame"}, from(4)}), 401);
  EXPECT_EQ(http_get(server_->admin_port(), "/metrics", {{"host", "evil.example"}}).status, 403);
  EXPECT_EQ(count("catgs_requests_refused_total"), 5.0);
  const std::string lines = log();
  EXPECT_THAT(lines, HasSubstr("198.51.100.1: request refused: "));
  EXPECT_THAT(lines, HasSubstr("198.51.100.2: websocket refused: "));
  EXPECT_THAT(lines, HasSubstr("198.51.100.3: upload refused: origin "));
  EXPECT_THAT(lines, HasSubstr("198.51.100.4: upload refused: 401: "));
  EXPECT_THAT(lines, HasSubstr("127.0.0.1: request refused: ")) << "on the admin port";
  EXPECT_THAT(lines, Not(HasSubstr("sesame")));
}

TEST_F(Refusals, OfMessagesNameTheAddress) {
  const auto closed_after = [&](const std::string& message, bool binary) {
    WireClient client(server_->port(), {.origin = "", .forwarded_for = "198.51.100.7"});
    client.send_bytes(message, binary);
    return client.receive_until_closed().close_code;
  };
  EXPECT_EQ(closed_after("hello", false), 1003);
  EXPECT_EQ(closed_after(std::string(70'000, 'x'), true), 1009);
  EXPECT_TRUE(eventually([&] { return count("catgs_sessions_refused_total") == 2.0; }));
  EXPECT_EQ(count("catgs_bad_messages_total"), 2.0);
  const std::string lines = log();
  EXPECT_THAT(lines, HasSubstr("198.51.100.7: binary messages only"));
  EXPECT_THAT(lines, HasSubstr("198.51.100.7: message over 64 KiB"));
}

}  // namespace
}  // namespace catgs::test

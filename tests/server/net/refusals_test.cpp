// Integration: who is refused is told to the operator, with the address and in a counter. Real
// sockets on loopback, a whole server in this process.

#include <sstream>

#include <boost/system/system_error.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <spdlog/sinks/ostream_sink.h>
#include <spdlog/spdlog.h>

#include "tests/support/raw_socket.h"
#include "tests/support/server_client.h"
#include "tests/support/temporary_folder.h"

namespace catgs::test {
namespace {

using testing::AnyOf;
using testing::HasSubstr;
using testing::Not;

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

TEST_F(Refusals, NameTheAddressBehindTheProxy) {
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

TEST_F(Refusals, RequestsWithoutATokenOrInABadFormAreCounted) {
  const int port = server_->port();
  const std::string head = " HTTP/1.1\r\nHost: localhost\r\n";
  const std::string sidecar = "PUT /api/scenes/city/sidecar" + head;
  double refused = 0.0;
  for (const auto& [request, status] : std::vector<std::pair<std::string, std::string>>{
           {"GET /api/scenes" + head, " 401 "},
           {"GET /api/scenes/city/tours" + head, " 401 "},
           {"DELETE /" + head, " 405 "},
           {"GET /" + head + "Content-Length: 5\r\n", " 413 "},
           {"GET /" + head + "Content-Length: five\r\n", " 400 "},
           {"POST /" + head + "Transfer-Encoding: chunked\r\n", " 411 "},
           {sidecar + "Content-Length: 0\r\n", " 411 "},
           {sidecar + "Content-Length: 99999999\r\n", " 413 "},
           {"GET /" + head + "Connection: Upgrade\r\nUpgrade: h2c\r\n", " 400 "},
           {"GET /" + head + "Upgrade: websocket\r\n", " 400 "},
           {"GET /" + head + "Connection: close\r\nUpgrade: websocket\r\n", " 400 "}}) {
    RawSocket socket(port);
    socket.send(request + "\r\n");
    std::string answer;
    EXPECT_TRUE(socket.receive_until("\r\n", answer)) << request;
    EXPECT_THAT(answer.substr(0, answer.find("\r\n")), HasSubstr(status)) << request;
    EXPECT_EQ(count("catgs_requests_refused_total"), ++refused) << request;
  }
  EXPECT_EQ(http_get(port, "/atlantis").status, 404);
  EXPECT_EQ(count("catgs_requests_refused_total"), refused) << "not found is not refused";
}

/// It answers none of these, and each costs it a line of its own.
TEST_F(Refusals, RefusalsByLibwebsocketsAreCounted) {
  const std::string line_end = " HTTP/1.1\r\nHost: localhost\r\n";
  std::string arguments = "?a";
  for (int i = 0; i < 100; ++i) arguments += "&a";
  double refused = 0.0;
  for (const std::string& request :
       {"GET /" + line_end + "Cookie: " + std::string(9000, 'c') + "\r\n",
        "GET /" + arguments + line_end,
        "GET /" + line_end + "Connection: Upgrade\r\nUpgrade: websocket\r\n" +
            "Sec-WebSocket-Protocol: " + std::string(200, 'p') + "\r\n",
        "CONNECT /" + line_end}) {
    RawSocket socket(server_->port());
    socket.send(request + "\r\n");
    EXPECT_TRUE(socket.closed_within(std::chrono::seconds(20))) << request;
    EXPECT_EQ(count("catgs_requests_refused_total"), ++refused) << request;
  }
  const std::string lines = log();
  EXPECT_THAT(lines, HasSubstr("libwebsockets: Ran out of header data space"));
  EXPECT_THAT(lines, HasSubstr("libwebsockets: More hdr frags than we can deal with"));
  EXPECT_THAT(lines, HasSubstr("libwebsockets: lws_process_ws_upgrade: protocol list too long"));
  EXPECT_THAT(lines, HasSubstr("127.0.0.1: request refused: this is no proxy"));
}

TEST_F(Refusals, SayNotMoreThanALittleOfWhatTheStrangerSent) {
  const std::string host(1000, 'h');
  const std::string origin = "https://" + std::string(1000, 'o');
  http_get(server_->port(), "/", {{"host", host}});
  http_put(server_->port(), "/api/scenes/city/sidecar", "{}", {{"origin", origin}});
  const std::string lines = log();
  EXPECT_THAT(lines, HasSubstr(host.substr(0, 100) + "..."));
  EXPECT_THAT(lines, HasSubstr(origin.substr(0, 100) + "..."));
  EXPECT_THAT(lines, Not(AnyOf(HasSubstr(host.substr(0, 101)), HasSubstr(origin.substr(0, 101)))));
}

TEST_F(Refusals, BadMessagesNameTheAddress) {
  const auto closed_after = [&](const std::string& message, bool binary) {
    WireClient client(server_->port(), {.origin = "", .forwarded_for = "198.51.100.7"});
    client.send_bytes(message, binary);
    return client.receive_until_closed().close_code;
  };
  EXPECT_EQ(closed_after("hello", false), 1003);
  EXPECT_EQ(closed_after(std::string(70'000, 'x'), true), 1009);
  v1::ClientMessage early;
  early.mutable_pause();
  EXPECT_EQ(closed_after(early.SerializeAsString(), true), 1008);
  EXPECT_TRUE(eventually([&] { return count("catgs_sessions_refused_total") == 3.0; }));
  EXPECT_EQ(count("catgs_bad_messages_total"), 3.0);
  const std::string lines = log();
  EXPECT_THAT(lines, HasSubstr("198.51.100.7: binary messages only"));
  EXPECT_THAT(lines, HasSubstr("198.51.100.7: message over 64 KiB"));
}

}  // namespace
}  // namespace catgs::test

// Integration: who is refused is told to the operator, with the address and in a counter. Real
// sockets on loopback, a whole server in this process.

#include <boost/system/system_error.hpp>

#include "tests/support/captured_log.h"
#include "tests/support/raw_socket.h"
#include "tests/support/server_client.h"
#include "tests/support/test.h"

namespace catgs::test {
namespace {

/// One server for all cases, which look at what is new in its counters and in the log.
class Refusals : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    log = std::make_unique<CapturedLog>();
    server = std::make_unique<RunningServer>([](ServerConfig& config) {
      config.trusted_proxies = {"127.0.0.0/8"};
      config.token_key_file = link_key_file();
    });
  }
  static void TearDownTestSuite() {
    server.reset();
    log.reset();
  }
  static double count(const std::string& name) { return metric(*server, name); }
  double refused() const { return count("catgs_requests_refused_total") - refused_before_; }
  static bool logged(const std::string& text) {
    return eventually([&] { return log->text().find(text) != std::string::npos; });
  }

  static inline std::unique_ptr<CapturedLog> log;
  static inline std::unique_ptr<RunningServer> server;

 private:
  const double refused_before_ = count("catgs_requests_refused_total");
};

TEST_F(Refusals, NameTheAddressBehindTheProxy) {
  const auto from = [](int host) {
    return std::pair<const std::string, std::string>("x-forwarded-for",
                                                     "198.51.100." + std::to_string(host));
  };
  const int port = server->port();
  EXPECT_EQ(http_get(port, "/", {{"host", "evil.example"}, from(1)}).status, 403);
  EXPECT_THROW(
      WireClient(port, {.origin = "https://evil.example", .forwarded_for = from(2).second}),
      boost::system::system_error);
  const auto put = [&](std::map<std::string, std::string> headers) {
    return http_put(port, "/api/scenes/city/sidecar", "{}", headers).status;
  };
  EXPECT_EQ(put({{"origin", "https://evil.example"}, from(3)}), 403);
  EXPECT_EQ(put({{"authorization", "Bearer open-sesame"}, from(4)}), 401);
  EXPECT_EQ(http_get(server->admin_port(), "/metrics", {{"host", "admin.example"}}).status, 403);
  EXPECT_EQ(refused(), 5.0);
  for (const char* line :
       {"198.51.100.1: request refused: ", "198.51.100.2: websocket refused: ",
        "198.51.100.3: upload refused: origin ", "198.51.100.4: upload refused: 401: ",
        "127.0.0.1: request refused: this server is not known as admin.example"})
    EXPECT_TRUE(logged(line)) << line;
  EXPECT_THAT(log->text(), Not(HasSubstr("sesame")));
}

TEST_F(Refusals, RequestsWithoutATokenOrInABadFormAreCounted) {
  const int port = server->port();
  const std::string head = " HTTP/1.1\r\nHost: localhost\r\n";
  const std::string sidecar = "PUT /api/scenes/city/sidecar" + head;
  double expected = 0.0;
  for (const auto& [request, status] : std::vector<std::pair<std::string, std::string>>{
           {"GET /api/scenes" + head, "401 "},
           {"GET /api/scenes/city/tours" + head, "401 "},
           {"DELETE /" + head, "405 "},
           {"GET /" + head + "Content-Length: 5\r\n", "413 "},
           {"GET /" + head + "Content-Length: five\r\n", "400 "},
           {"POST /" + head + "Transfer-Encoding: chunked\r\n", "411 "},
           {sidecar + "Content-Length: 0\r\n", "411 "},
           {sidecar + "Content-Length: 99999999\r\n", "413 "},
           {"GET /" + head + "Connection: Upgrade\r\nUpgrade: h2c\r\n", "400 "},
           {"GET /" + head + "Upgrade: websocket\r\n", "400 "},
           {"GET /" + head + "Connection: close\r\nUpgrade: websocket\r\n", "400 "}}) {
    EXPECT_THAT(raw_answer(port, request + "\r\n"),
                testing::AnyOf(StartsWith("HTTP/1.1 " + status), StartsWith("HTTP/1.0 " + status)))
        << request;
    EXPECT_EQ(refused(), ++expected) << request;
  }
  EXPECT_EQ(http_get(port, "/atlantis").status, 404);
  EXPECT_EQ(refused(), expected) << "not found is not refused";
}

/// It answers none of these, and each costs it a line of its own.
TEST_F(Refusals, RefusalsByLibwebsocketsAreCounted) {
  const std::string line_end = " HTTP/1.1\r\nHost: localhost\r\n";
  std::string arguments = "?a";
  for (int i = 0; i < 100; ++i) arguments += "&a";
  double expected = 0.0;
  for (const std::string& request :
       {"GET /" + line_end + "Cookie: " + std::string(30000, 'c') + "\r\n",
        "GET /" + arguments + line_end,
        "GET /" + line_end + "Connection: Upgrade\r\nUpgrade: websocket\r\n" +
            "Sec-WebSocket-Protocol: " + std::string(200, 'p') + "\r\n",
        "CONNECT /" + line_end}) {
    RawSocket socket(server->port());
    socket.send(request + "\r\n");
    EXPECT_TRUE(socket.closed_within(std::chrono::seconds(20))) << request;
    EXPECT_EQ(refused(), ++expected) << request;
  }
  for (const char* line : {"libwebsockets: Ran out of header data space",
                           "libwebsockets: More hdr frags than we can deal with",
                           "libwebsockets: lws_process_ws_upgrade: protocol list too long",
                           "127.0.0.1: request refused: this is no proxy"})
    EXPECT_TRUE(logged(line)) << line;
}

TEST_F(Refusals, SayNotMoreThanALittleOfWhatTheStrangerSent) {
  const std::string host(1000, 'h');
  const std::string origin = "https://" + std::string(1000, 'o');
  http_get(server->port(), "/", {{"host", host}});
  http_put(server->port(), "/api/scenes/city/sidecar", "{}", {{"origin", origin}});
  for (const std::string& sent : {host, origin}) {
    EXPECT_TRUE(logged(sent.substr(0, 100) + "..."));
    EXPECT_THAT(log->text(), Not(HasSubstr(sent.substr(0, 101))));
  }
}

TEST_F(Refusals, BadMessagesNameTheAddress) {
  const double sessions = count("catgs_sessions_refused_total");
  const double messages = count("catgs_bad_messages_total");
  const auto closed_after = [&](const std::string& message, bool binary) {
    WireClient client(server->port(), {.origin = "", .forwarded_for = "198.51.100.7"});
    client.send_bytes(message, binary);
    return client.receive_until_closed().close_code;
  };
  EXPECT_EQ(closed_after("hello", false), 1003);
  EXPECT_EQ(closed_after(std::string(70'000, 'x'), true), 1009);
  v1::ClientMessage early;
  early.mutable_pause();
  EXPECT_EQ(closed_after(early.SerializeAsString(), true), 1008);
  EXPECT_TRUE(eventually([&] { return count("catgs_sessions_refused_total") == sessions + 3.0; }));
  EXPECT_EQ(count("catgs_bad_messages_total"), messages + 3.0);
  EXPECT_TRUE(logged("198.51.100.7: binary messages only"));
  EXPECT_TRUE(logged("198.51.100.7: message over 64 KiB"));
}

}  // namespace
}  // namespace catgs::test

// HTTP by the byte, and crowds: what strangers may send to the port without a token. Real sockets
// on loopback, a whole server in this process.

#include <sys/resource.h>

#include "tests/support/descriptor_limit.h"
#include "tests/support/raw_socket.h"
#include "tests/support/server_client.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/test.h"
#include "tests/support/tls.h"

namespace catgs::test {
namespace {

constexpr std::string_view page_policy =
    "default-src 'none'; script-src 'self'; worker-src 'self'; connect-src 'self'; img-src 'self' "
    "blob: data:; media-src 'self'; style-src 'self'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'";

class HttpConformance : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    // Both ends of a thousand connections; libwebsockets takes what is allowed when it starts.
    rlimit limit{};
    ::getrlimit(RLIMIT_NOFILE, &limit);
    limit.rlim_cur = std::min<rlim_t>(limit.rlim_max, 8192);
    ::setrlimit(RLIMIT_NOFILE, &limit);
    folder.emplace();
    folder->write("web/index.html", "<!doctype html>the page");
    folder->write("web/large.bin", std::string(large_bytes, 'l'));
    folder->write("secret.txt", "the secret");
    server.emplace([](ServerConfig& config) {
      config.client_dir = (*folder / "web").string();
      config.max_sessions = 64;
      config.max_sessions_per_address = 150;  // connections follow it (AcceptGate::bounds_for)
    });
  }
  static void TearDownTestSuite() {
    server.reset();
    folder.reset();
  }

  static std::string host() { return "Host: 127.0.0.1:" + std::to_string(server->port()) + "\r\n"; }
  /// Everything that the server answers to `request`, sent as it is.
  static std::string answer(const std::string& request) {
    return raw_answer(server->port(), request);
  }
  static std::string answer_to_path(const std::string& path) {
    return answer("GET " + path + " HTTP/1.1\r\n" + host() + "\r\n");
  }
  static void expect_alive() {
    EXPECT_EQ(http_get(server->port(), "/healthz").status, 200);
    WireClient good(server->port());
    good.greet();
    good.send_pose(1);
    EXPECT_FALSE(good.receive_frame().bitstream.empty());
  }
  /// The server notices closed sockets a little later.
  static bool falls_to(std::ptrdiff_t descriptors) {
    for (int looks = 0; looks < 100; ++looks) {
      if (open_descriptors() <= descriptors) return true;
      std::this_thread::sleep_for(50ms);
    }
    return false;
  }

  static constexpr std::size_t large_bytes = 16 << 20;  // more than sockets hold
  static std::optional<TemporaryFolder> folder;
  static std::optional<RunningServer> server;
};

std::optional<TemporaryFolder> HttpConformance::folder;
std::optional<RunningServer> HttpConformance::server;

TEST_F(HttpConformance, NoPathLeadsOutOfTheClient) {
  for (const char* path :
       {"/../secret.txt", "/%2e%2e/secret.txt", "/%2e%2e%2fsecret.txt", "/..%5csecret.txt",
        "/%252e%252e/secret.txt", "/.%00./secret.txt", "/..;/secret.txt", "//../secret.txt",
        "/..%2fsecret.txt", "//etc/passwd", "/./../secret.txt", "/index.html/../../secret.txt",
        "/%c0%ae%c0%ae/secret.txt", "http://127.0.0.1/../secret.txt", "file:///etc/passwd", "*",
        "/api/scenes/../secret.txt/tours",
        "/api/scenes/%2e%2e%2f%2e%2e%2fetc%2fpasswd/poster.jpg"}) {
    const std::string reply = answer_to_path(path);
    EXPECT_THAT(reply, Not(AnyOf(HasSubstr("the secret"), HasSubstr("root:")))) << path;
    EXPECT_THAT(reply, Not(HasSubstr("HTTP/1.1 200"))) << path;
  }
  expect_alive();
}

TEST_F(HttpConformance, NoRequestWritesHeadersOfTheAnswer) {
  for (const std::string& request :
       {"GET /%0d%0aX-Planted:%201 HTTP/1.1\r\n" + host() + "\r\n",
        "GET /?a=%0d%0aX-Planted:%201 HTTP/1.1\r\n" + host() + "\r\n",
        "GET / HTTP/1.1\r\n" + host() + "If-None-Match: a%0d%0aX-Planted: 1\r\n\r\n",
        std::string("GET / HTTP/1.1\r\nHost: evil\rX-Planted: 1\r\n\r\n"),
        std::string("GET / HTTP/1.1\r\nHost: evil%0d%0aX-Planted: 1\r\n\r\n")}) {
    const std::string reply = answer(request);
    const std::string head = reply.substr(0, reply.find("\r\n\r\n"));
    EXPECT_THAT(head, Not(AnyOf(HasSubstr("X-Planted"), HasSubstr("x-planted")))) << request;
  }
  expect_alive();
}

TEST_F(HttpConformance, EveryAnswerHasTheSecurityHeaders) {
  for (const auto& [port, target] :
       std::vector<std::pair<int, std::string>>{{server->port(), "/"},
                                                {server->port(), "/nowhere"},
                                                {server->port(), "/healthz"},
                                                {server->port(), "/api/scenes"},
                                                {server->port(), "/api/scenes/city/poster.jpg"},
                                                {server->admin_port(), "/metrics"},
                                                {server->admin_port(), "/api/sessions"}}) {
    const HttpReply reply = http_get(port, target);
    EXPECT_EQ(reply.headers.at("content-security-policy"), page_policy) << target;
    EXPECT_EQ(reply.headers.at("x-content-type-options"), "nosniff") << target;
    EXPECT_EQ(reply.headers.at("referrer-policy"), "no-referrer") << target;
    EXPECT_EQ(reply.headers.at("cross-origin-resource-policy"), "same-origin") << target;
    EXPECT_FALSE(reply.headers.contains("access-control-allow-origin")) << target;
    EXPECT_EQ(reply.headers.at("connection"), "close") << target;
  }
  // Those that libwebsockets makes.
  for (const std::string& request :
       {"GET /%zz HTTP/1.1\r\n" + host() + "\r\n", "POST / HTTP/1.1\r\n" + host() + "\r\n",
        "NONSENSE / HTTP/1.1\r\n" + host() + "\r\n"})
    EXPECT_THAT(answer(request), AllOf(HasSubstr("x-content-type-options: nosniff\r\n"),
                                       HasSubstr("connection: close\r\n")))
        << request;
}

TEST_F(HttpConformance, OtherMethodsAreRefused) {
  for (const char* method : {"POST", "PUT", "DELETE", "PATCH", "OPTIONS", "TRACE", "CONNECT",
                             "PROPFIND", "NONSENSE", "get"}) {
    const std::string reply =
        answer(std::string(method) + " /api/sessions HTTP/1.1\r\n" + host() + "\r\n");
    EXPECT_THAT(reply, Not(HasSubstr(" 200 "))) << method;
  }
  expect_alive();
}

TEST_F(HttpConformance, AHeadHasNoBody) {
  EXPECT_THAT(answer("HEAD / HTTP/1.1\r\n" + host() + "\r\n"),
              AllOf(StartsWith("HTTP/1.1 200"), EndsWith("\r\n\r\n")));
}

TEST_F(HttpConformance, ALargeAnswerComesWhole) {
  RawSocket socket(server->port());
  socket.send("GET /large.bin HTTP/1.1\r\n" + host() + "\r\n");
  const std::string reply = socket.receive(20s);
  EXPECT_EQ(reply.size() - reply.find("\r\n\r\n") - 4, large_bytes);
}

/// libwebsockets gives an answer five seconds.
TEST_F(HttpConformance, ALargeAnswerComesWholeToASlowClient) {
  RawSocket socket(server->port(), true);
  socket.send("GET /large.bin HTTP/1.1\r\n" + host() + "\r\n");
  std::string reply;
  for (int i = 0; i < 65; ++i) {
    ASSERT_TRUE(socket.receive_bytes(1 << 16, reply)) << "cut off after " << reply.size();
    std::this_thread::sleep_for(100ms);
  }
  reply += socket.receive(20s);
  EXPECT_EQ(reply.size() - reply.find("\r\n\r\n") - 4, large_bytes);
}

/// What comes behind a request may be its body to a proxy, which reads another length than the
/// server does, or any: then another visitor would get the answer to it.
TEST_F(HttpConformance, AConnectionAnswersOneRequest) {
  const std::string hidden = "GET /healthz HTTP/1.1\r\n" + host() + "\r\n";
  const std::string length = std::to_string(hidden.size());
  const std::string chunk = "29\r\n" + hidden + "\r\n0\r\n\r\n";
  const std::string nul(1, '\0');
  std::vector<std::pair<std::string, std::string>> requests = {
      {"", hidden},  // a second one
      {"Transfer-Encoding : chunked\r\n", hidden},
      {"Transfer-Encoding : chunked\r\n", chunk},
      {"Transfer-Encoding\v: chunked\r\n", hidden},
      {"Transfer-Encoding: \vchunked\r\n", hidden},
      {"Content-Length: 0\r\nContent-Length: " + length + "\r\n", hidden},
      {"Content-Length: " + length + "\r\nContent-Length: 0\r\n", hidden},
      {"Content-Length: 0, " + length + "\r\n", hidden}};
  for (const std::string& before :
       {std::string("Content-Length : "), std::string("Content-Length\t: "),
        std::string("Content-Length\v: "), "Content-Length" + nul + ": ",
        std::string("Content-Length:+"), std::string("Content-Length:\v"),
        std::string(" Content-Length: "), std::string("X: 1\r\n Content-Length: "),
        std::string("X: 1\r\n\tContent-Length: "), std::string("X: 1\rContent-Length: "),
        std::string("X: 1\nContent-Length: "), std::string("X: 1\n Content-Length: "),
        std::string("Accept: 1\rContent-Length: "), "X: " + nul + "\r\n Content-Length: ",
        std::string("no colon\r\nContent-Length: "), std::string(": \r\n Content-Length: ")})
    requests.emplace_back(before + length + "\r\n", hidden);
  const auto answers = [](const std::string& reply) {
    int count = 0;
    for (std::size_t at = 0; (at = reply.find("HTTP/1.", at)) != reply.npos; ++at) ++count;
    return count;
  };
  for (const int port : {server->port(), server->admin_port()})
    for (const auto& [lines, behind] : requests) {
      const std::string request = "GET /api/scenes HTTP/1.1\r\n" + host() + lines + "\r\n";
      RawSocket at_once(port);
      at_once.send(request + behind);
      EXPECT_EQ(answers(at_once.receive(1s)), 1) << lines;
      RawSocket later(port);
      later.send(request);
      std::string reply;
      later.receive_until("\r\n\r\n", reply);
      later.send(behind);
      EXPECT_EQ(answers(reply + later.receive(1s)), 1) << lines;
    }
  expect_alive();
}

/// A proxy in front counts bodies: a request hidden in one must not be answered here. libwebsockets
/// reads a length by its first 30 characters, or takes none, or one that is wrong.
TEST_F(HttpConformance, ABodyIsNoSecondRequest) {
  const std::string hidden = "GET /healthz HTTP/1.1\r\n" + host() + "\r\n";
  const std::string size = std::to_string(hidden.size()) + "\r\n\r\n" + hidden;
  for (const std::string& body :
       {"Content-Length: " + size, "Content-Length: " + std::string(40, '0') + size,
        std::string("Transfer-Encoding: chunked\r\n\r\n0\r\n\r\n")})
    for (const std::string method : {"GET", "HEAD", "PUT"})
      EXPECT_THAT(answer(method + " /nowhere HTTP/1.1\r\n" + host() + body),
                  Not(HasSubstr("200 OK")))
          << method << ": " << body;
  expect_alive();
}

/// libwebsockets looks for their bodies in a loop that does not end.
TEST_F(HttpConformance, PipelinedBodiesDoNotStopTheServer) {
  const std::string get = "GET / HTTP/1.1\r\n" + host() + "\r\n";
  for (const std::string method : {"GET", "HEAD", "PUT"}) {
    const std::string odd =
        method + " /api/scenes/city/sidecar HTTP/1.1\r\n" + host() + "Content-Length: 1\r\n\r\nx";
    for (const std::string& requests : {odd + odd + odd, get + odd, get + odd + get, odd + get})
      answer(requests);
    expect_alive();
  }
}

/// CONNECT and h2c lead libwebsockets to protocols that nobody here speaks, without time limits.
TEST_F(HttpConformance, NothingButAWebsocketIsUpgradedTo) {
  const std::string get = "GET /healthz HTTP/1.1\r\n" + host();
  for (const std::string& request :
       {"CONNECT / HTTP/1.1\r\n" + host() + "\r\n",
        get + "Connection: Upgrade, HTTP2-Settings\r\nUpgrade: h2c\r\n"
              "HTTP2-Settings: AAMAAABkAAQAAP__\r\n\r\n",
        get + "Connection: Upgrade\r\nUpgrade: nonsense\r\n\r\n",
        get + "\r\n" + get + "Connection: Upgrade\r\nUpgrade: nonsense\r\n\r\n"}) {
    RawSocket socket(server->port());
    socket.send(request);
    EXPECT_THAT(socket.receive(20s), Not(HasSubstr(" 101 "))) << request;
    EXPECT_TRUE(socket.closed_within(1ms)) << request;
  }
  expect_alive();
}

TEST_F(HttpConformance, HeadersHaveAnEnd) {
  const std::string start = "GET /healthz HTTP/1.1\r\n" + host();
  const auto with_cookie = [&](std::size_t bytes) {
    return answer(start + "Cookie: " + std::string(bytes, 'c') + "\r\n\r\n");
  };
  EXPECT_THAT(with_cookie(15'000), HasSubstr(" 200 OK")) << "logins of proxies take that much";
  EXPECT_THAT(with_cookie(17'000), AllOf(HasSubstr(" 431 "), HasSubstr("clear cookies")));
  EXPECT_THAT(answer(start + "Cookie: " + std::string(100'000, 'c') + "\r\n\r\n"),
              Not(HasSubstr("200 OK")));
  EXPECT_THAT(answer("GET /" + std::string(100'000, 'a') + " HTTP/1.1\r\n" + host() + "\r\n"),
              Not(HasSubstr("200 OK")));
  std::string many = start;
  for (int i = 0; i < 20'000; ++i) many += "X-" + std::to_string(i) + ": 1\r\n";
  answer(many + "\r\n");
  for (const std::string& garbage :
       {std::string(5000, '\0'), std::string(5000, '\xff'), std::string("\r\n\r\n\r\n"),
        std::string("GET\r\n\r\n"),
        std::string("\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03", 11)})
    EXPECT_THAT(answer(garbage), Not(HasSubstr("the page")));
  expect_alive();
}

/// Slow senders, the silent, who does not read, and websockets that do not answer pings: all at
/// once, because each takes its time. `request_timeout_s` is 10, `hang_up_after_s` 30
/// (server/net/net_server.cpp), `grace` 10 (server/net/body_deadline.h) and `piece_timeout_s` 30
/// (server/net/lws_http.cpp).
TEST_F(HttpConformance, SlowAndSilentPeersAreHungUp) {
  write_self_signed(*folder / "certificate.pem", *folder / "key.pem");
  const RunningServer https([&](ServerConfig& config) {
    config.tls_cert = (*folder / "certificate.pem").string();
    config.tls_key = (*folder / "key.pem").string();
  });
  const std::ptrdiff_t before = open_descriptors();
  {
    std::vector<RawSocket> slow;
    for (int i = 0; i < 20; ++i) {
      slow.emplace_back(server->port());
      if (i % 2 == 1)
        slow.back().send("PUT /api/scenes/city/sidecar HTTP/1.1\r\n" + host() +
                         "Content-Length: 1000\r\n\r\n");
    }
    std::vector<RawSocket> silent;
    for (int i = 0; i < 20; ++i) silent.emplace_back(server->port());
    for (const char* begun : {"", "\x16", "\x16\x03\x01\x02"}) {  // handshakes of TLS
      silent.emplace_back(https.port());
      silent.back().send(begun);
      slow.emplace_back(https.port());
      slow.back().send(begun);
    }
    // X-A is the beginning of a name that libwebsockets knows, and it waits for the rest.
    silent.front().send("GET /healthz HTTP/1.1\r\n" + host() + "X-A: 1\r\n\r\n");
    RawSocket reads_nothing(server->port(), true);
    reads_nothing.send("GET /large.bin HTTP/1.1\r\n" + host() + "\r\n");
    RawSocket half_open(server->port());
    half_open.send(handshake(server->port()));
    half_open.send(client_frame(ws_fin | ws_binary,
                                hello_message(64, 64, v1::CODEC_H264).SerializeAsString()));
    std::string received;
    EXPECT_TRUE(half_open.receive_until("city", received));
    const std::string request =
        "GET /healthz HTTP/1.1\r\nX-Slow: aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa";
    bool all_closed = false;
    for (std::size_t second = 0; second < 45 && !all_closed; ++second) {
      all_closed = true;
      for (RawSocket& socket : slow)
        if (!socket.closed_within(1ms)) {
          all_closed = false;
          socket.send(request.substr(second, 1));
        }
      std::this_thread::sleep_for(1s);
    }
    EXPECT_TRUE(all_closed) << "a byte a second keeps a connection";
    for (RawSocket& socket : silent) EXPECT_TRUE(socket.closed_within(5s));
    expect_alive();
    // Its kernel acknowledges what the server sends, but no pong comes.
    EXPECT_TRUE(half_open.closed_within(45s));
    EXPECT_TRUE(eventually([&] { return !reads_nothing.send("x"); }));
  }
  EXPECT_TRUE(falls_to(before + 4));
}

TEST_F(HttpConformance, AThousandConnectionsLeaveRoomForOneMore) {
  const std::ptrdiff_t before = open_descriptors();
  {
    std::vector<RawSocket> crowd;
    for (int i = 0; i < 1000; ++i) {
      crowd.emplace_back(server->port());
      if (i % 4 == 1) crowd.back().send("GET / HT");
      if (i % 4 == 2) crowd.back().send(handshake(server->port()));
      if (i % 4 == 3) crowd.back().send("GET /healthz HTTP/1.1\r\n" + host() + "\r\n");
    }
    EXPECT_EQ(http_get(server->port(), "/healthz").status, 200);
    // All come from one address, which has no place left for websockets.
    WireClient late(server->port());
    std::optional<v1::Error> error;
    late.receive_until_closed(&error);
    ASSERT_TRUE(error);
    EXPECT_EQ(error->code(), v1::Error::SERVER_FULL);
  }
  EXPECT_TRUE(falls_to(before + 4)) << open_descriptors() << " now, " << before << " before";
  expect_alive();
}

TEST_F(HttpConformance, AStormOfReconnectsLeavesNothingBehind) {
  WireClient good(server->port());
  good.greet();
  std::string resume_token;
  {
    WireClient first(server->port());
    resume_token = first.greet().resume_token();
  }
  const std::ptrdiff_t before = open_descriptors();
  std::vector<std::thread> threads;
  for (int t = 0; t < 4; ++t)
    threads.emplace_back([&, t] {
      for (int i = 0; i < 100; ++i) {
        RawSocket socket(server->port());
        const int phase = (i + t) % 5;
        if (phase == 1) socket.send("GET / HTTP/1.1\r\nUpgr");
        if (phase >= 2) socket.send(handshake(server->port()));
        std::string received;
        if (phase >= 3) socket.receive_until("\r\n\r\n", received);
        if (phase >= 4)
          socket.send(client_frame(ws_fin | ws_binary,
                                   resuming_hello(resume_token, 7).SerializeAsString()));
      }
    });
  for (std::thread& thread : threads) thread.join();
  EXPECT_TRUE(falls_to(before + 4)) << open_descriptors() << " now, " << before << " before";
  good.send_pose(1);
  EXPECT_FALSE(good.receive_frame().bitstream.empty());
  WireClient back(server->port());
  EXPECT_FALSE(back.greet(resuming_hello(resume_token, 9)).session_id().empty());
}

}  // namespace
}  // namespace catgs::test

// Integration: what keeps the thread of libwebsockets busy, and what follows when it fails. A whole
// server in this process.

#include <dlfcn.h>

#include "render_core/scene/files/save_scene.h"
#include "tests/render_core/scene/random_cloud.h"
#include "tests/support/raw_socket.h"
#include "tests/support/server_client.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/test.h"
#include "tests/support/tls.h"

namespace {

std::atomic<bool> network_fails{false};
std::atomic<int> services{0};  // of the network thread

}  // namespace

/// Stands before that of the shared library.
struct lws_context;
extern "C" int lws_service(lws_context* context, int timeout_ms) {
  static const auto service =
      reinterpret_cast<decltype(&lws_service)>(::dlsym(RTLD_NEXT, "lws_service"));
  ++services;
  return network_fails ? -1 : service(context, timeout_ms);
}

namespace catgs::test {
namespace {

TEST(ServerFaults, EndsForItsSupervisorWhenTheNetworkThreadFails) {
  const ServerConfig config = quiet_config();
  Server server(config);
  auto ended = std::async(std::launch::async, [&] { server.run(); });
  const Stopped stopped(server);
  RawSocket waker(server.port());
  EXPECT_EQ(http_get(server.port(), "/healthz").status, 200);
  network_fails = true;
  waker.send("G");
  EXPECT_THAT([&] { ended.get(); },  // main() makes it exit status 1
              ThrowsMessage<std::runtime_error>("the network thread failed"));
  network_fails = false;
}

/// How often libwebsockets looks what there is to do before it has answered who came last. All wait
/// in the backlog when the server begins: `crowd` connections that have sent `begun`, and that one.
int rounds_behind(int crowd, const std::string& begun, const ServerConfig& config) {
  Server server(config);
  std::vector<RawSocket> others;
  for (int i = 0; i < crowd; ++i) {
    others.emplace_back(server.port());
    others.back().send(begun);
  }
  RawSocket last(server.port());
  last.send("GET / HTTP/1.1\r\nHost: localhost\r\n\r\n");
  services = 0;
  auto ended = std::async(std::launch::async, [&] { server.run(); });
  const Stopped stopped(server);
  std::string answer;
  EXPECT_TRUE(last.receive_until("HTTP/1.1 ", answer)) << answer;
  return services;
}

/// libwebsockets accepts all that wait, and as long as others come: visitors' frames would wait.
TEST(ServerFaults, FewConnectionsAreAcceptedInARound) {
  EXPECT_GE(rounds_behind(200, "", quiet_config()), 200 / 8);
}

TEST(ServerFaults, FailedHandshakesEndTheirRound) {
  const TemporaryFolder folder;
  ServerConfig config = quiet_config();
  config.tls_cert = (folder / "certificate.pem").string();
  config.tls_key = (folder / "key.pem").string();
  write_self_signed(config.tls_cert, config.tls_key);
  EXPECT_GE(rounds_behind(1000, "\x16 no handshake", config), 1000 / 65);
}

/// How often libwebsockets looks what there is to do.
int services_in(std::chrono::milliseconds time) {
  const int before = services;
  std::this_thread::sleep_for(time);
  return services - before;
}

/// One connection that takes no more of its answer while libwebsockets has something to read of it.
class UnreadAnswer : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::make_unique<TemporaryFolder>();
    folder_->write("index.html", "<!doctype html>");
    folder_->write("large.bin", std::string(large_bytes, 'l'));
    server_ = std::make_unique<RunningServer>(
        [](ServerConfig& config) { config.client_dir = folder_->path().string(); });
  }
  static void TearDownTestSuite() {
    server_.reset();
    folder_.reset();
  }
  void expect_whole_answer() {
    const std::string reply = socket_.receive(5s);
    EXPECT_EQ(reply.size() - reply.find("\r\n\r\n") - 4, large_bytes);
  }

  static constexpr std::size_t large_bytes = 16 << 20;  // more than sockets hold
  static constexpr std::string_view request = "GET /large.bin HTTP/1.1\r\nHost: localhost\r\n\r\n";
  static inline std::unique_ptr<TemporaryFolder> folder_;
  static inline std::unique_ptr<RunningServer> server_;
  RawSocket socket_{server_->port()};
};

TEST_F(UnreadAnswer, KeepsNoThreadBusyByBytesThatCameWithTheRequest) {
  socket_.send(std::string(request) + "x");
  EXPECT_TRUE(eventually([] { return services_in(250ms) < 25; }));
  expect_whole_answer();
}

TEST_F(UnreadAnswer, KeepsNoThreadBusyByBytesThatComeLater) {
  socket_.send(request);
  std::string head;
  ASSERT_TRUE(socket_.receive_until("\r\n\r\n", head));
  socket_.send(std::string(100'000, 'x'));
  EXPECT_TRUE(eventually([] { return services_in(250ms) < 25; }));
}

TEST_F(UnreadAnswer, KeepsNoThreadBusyWhereTheClientHasNoMoreToSay) {
  socket_.send(request);
  socket_.end_sending();
  EXPECT_TRUE(eventually([] { return services_in(250ms) < 25; }));
  expect_whole_answer();
}

TEST(ServerFaults, ClosingAWebsocketThatReadsNothingKeepsNoThreadBusy) {
  const TemporaryFolder folder;
  save_scene(random_cloud(1, 0), folder / "a.ply");
  for (int i = 0; i < 3000; ++i)  // a welcome has all names
    std::filesystem::create_hard_link(
        folder / "a.ply", folder / (std::to_string(i) + std::string(100, 'n') + ".ply"));
  const RunningServer server([&](ServerConfig& config) { config.scene_folders = {folder.path()}; });
  RawSocket socket(server.port(), true);
  socket.send(handshake(server.port()));
  socket.send(
      client_frame(ws_fin | ws_binary, hello_message(64, 64, v1::CODEC_H264).SerializeAsString()));
  std::string received;
  ASSERT_TRUE(socket.receive_until("nnnnn", received));
  const std::string refused = client_frame(ws_fin | ws_text, "hello");
  socket.send(refused);
  ASSERT_TRUE(eventually([&] { return metric(server, "catgs_bad_messages_total") == 1.0; }));
  socket.send(refused);
  EXPECT_LT(services_in(1s), 9000);  // tens of thousands without the pauses
}

}  // namespace
}  // namespace catgs::test

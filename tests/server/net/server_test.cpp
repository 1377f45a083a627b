// Integration: real sockets on loopback, a whole server in this process.

#include "server/server.h"

#include <algorithm>
#include <filesystem>
#include <set>
#include <thread>

#include <boost/system/system_error.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include "render_core/error.h"
#include "render_core/scene/save_scene.h"
#include "render_core/scene/synth.h"
#include "server/access.h"
#include "tests/support/server_client.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/tls.h"

namespace catgs::test {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

std::string sessions_json(const RunningServer& server) {
  return http_get(server.admin_port(), "/api/sessions").body;
}

TEST(Server, StreamsTheNewestPose) {
  RunningServer server;
  WireClient client(server.port());
  const v1::Welcome welcome = client.greet(160, 96);
  EXPECT_EQ(welcome.version(), 1u);
  EXPECT_EQ(welcome.scene().scene_id(), "city");
  EXPECT_EQ(welcome.scene().gaussians(), 2000u);
  EXPECT_THAT(welcome.config().codec_string(), HasSubstr("avc1."));
  EXPECT_EQ(welcome.config().width_px(), 160u);

  std::uint64_t last_frame_id = 0;
  for (std::uint64_t id = 1; id <= 5; ++id) {
    client.send_pose(id, 0.1f * static_cast<float>(id));
    ReceivedFrame frame;
    do {  // frames that refine the still picture may come between
      frame = client.receive_frame();
      EXPECT_GT(frame.header.frame_id(), last_frame_id);
      EXPECT_EQ(frame.header.idr(), last_frame_id == 0);
      EXPECT_FALSE(frame.bitstream.empty());
      last_frame_id = frame.header.frame_id();
      client.send_ack(last_frame_id);
    } while (frame.header.pose_id() != id);
    EXPECT_EQ(frame.header.pose_client_time_us(), static_cast<std::int64_t>(id) * 1000);
    EXPECT_EQ(frame.header.width_px(), 160u);
  }
  v1::ClientMessage bye;
  bye.mutable_bye();
  client.send(bye);
  EXPECT_EQ(client.receive_until_closed().close_code, 1000);
}

TEST(Server, SendsJpegToAClientThatDecodesNothingElse) {
  RunningServer server;
  WireClient client(server.port());
  const auto welcome = client.greet(64, 48, v1::CODEC_MJPEG);
  EXPECT_EQ(welcome.config().codec(), v1::CODEC_MJPEG);
  client.send_pose(1);
  const ReceivedFrame frame = client.receive_frame();
  ASSERT_GE(frame.bitstream.size(), 2u);
  EXPECT_EQ(frame.bitstream[0], std::byte{0xff});
  EXPECT_EQ(frame.bitstream[1], std::byte{0xd8});
}

TEST(Server, NewSettingsGiveANewConfigAndThenAnIdr) {
  RunningServer server;
  WireClient client(server.port());
  client.greet(160, 96);
  client.send_pose(1);
  client.send_ack(client.receive_frame().header.frame_id());
  v1::ClientMessage settings;
  settings.mutable_settings()->set_width_px(320);
  settings.mutable_settings()->set_height_px(181);
  client.send(settings);
  const auto config = client.receive_message(v1::ServerMessage::kConfig).config();
  EXPECT_EQ(config.width_px(), 320u);
  EXPECT_EQ(config.height_px(), 180u);
  const ReceivedFrame frame = client.receive_frame();
  EXPECT_TRUE(frame.header.idr());
  EXPECT_EQ(frame.header.width_px(), 320u);
}

TEST(Server, CreditBoundsWhatIsInFlight) {
  RunningServer server;
  WireClient client(server.port());
  client.greet();
  // Never acknowledged: no round trip is known, so one frame may be in flight, whatever poses come.
  std::set<std::uint64_t> frames;
  for (std::uint64_t id = 1; id <= 40; ++id) client.send_pose(id, 0.05f * static_cast<float>(id));
  for (int heartbeats = 0; heartbeats < 2;) {
    const Received received = client.receive();
    ASSERT_FALSE(received.closed);
    if (received.frame) frames.insert(received.frame->header.frame_id());
    if (received.message && received.message->has_heartbeat()) ++heartbeats;
  }
  EXPECT_EQ(frames.size(), 1u);
  EXPECT_THAT(sessions_json(server), HasSubstr("\"frames_queued\":0"));
}

TEST(Server, SeveralSessionsShareOneScene) {
  RunningServer server;
  std::vector<std::unique_ptr<WireClient>> clients;
  for (int i = 0; i < 4; ++i) {
    clients.push_back(std::make_unique<WireClient>(server.port()));
    clients.back()->greet(64 + 16 * i, 48);
  }
  for (std::uint64_t id = 1; id <= 5; ++id) {
    for (auto& client : clients) client->send_pose(id, 0.1f * static_cast<float>(id));
    for (std::size_t i = 0; i < clients.size(); ++i) {
      const ReceivedFrame frame = clients[i]->receive_frame();
      EXPECT_EQ(frame.header.width_px(), 64 + 16 * i);
      clients[i]->send_ack(frame.header.frame_id());
    }
  }
}

TEST(Server, ABadMessageClosesItsSessionOnly) {
  RunningServer server;
  WireClient good(server.port());
  good.greet();
  WireClient bad(server.port());
  bad.greet();
  v1::ClientMessage message;
  message.mutable_pose()->set_fov_y_rad(9.0f);
  bad.send(message);
  std::optional<v1::Error> error;
  EXPECT_EQ(bad.receive_until_closed(&error).close_code, 1008);
  ASSERT_TRUE(error);
  EXPECT_EQ(error->code(), v1::Error::BAD_MESSAGE);
  EXPECT_TRUE(error->fatal());
  EXPECT_THAT(error->message(), HasSubstr("pose"));

  good.send_pose(1);
  EXPECT_FALSE(good.receive_frame().bitstream.empty());
}

TEST(Server, RefusesWhatIsNoMessage) {
  RunningServer server;
  std::optional<v1::Error> error;
  WireClient garbage(server.port());
  garbage.send_bytes(std::string("\xff\xff\xff\xff", 4));
  garbage.receive_until_closed(&error);
  ASSERT_TRUE(error);
  EXPECT_EQ(error->code(), v1::Error::BAD_MESSAGE);

  WireClient early(server.port());
  early.send_pose(1);
  error.reset();
  early.receive_until_closed(&error);
  ASSERT_TRUE(error);
  EXPECT_THAT(error->message(), HasSubstr("hello"));

  WireClient text(server.port());
  text.send_bytes("hello", false);
  EXPECT_EQ(text.receive_until_closed().close_code, 1003);

  WireClient huge(server.port());
  huge.send_bytes(std::string(65 * 1024, 'x'));
  EXPECT_EQ(huge.receive_until_closed().close_code, 1009);
}

TEST(Server, RefusesAnUnknownSceneAndAFullHouse) {
  RunningServer server([](ServerConfig& config) {
    config.max_sessions = 1;
    config.max_queue = 0;
  });
  std::optional<v1::Error> error;
  WireClient lost(server.port());
  auto hello = hello_message(64, 64, v1::CODEC_H264);
  hello.mutable_hello()->set_scene_id("atlantis");
  lost.send(hello);
  lost.receive_until_closed(&error);
  ASSERT_TRUE(error);
  EXPECT_EQ(error->code(), v1::Error::UNKNOWN_SCENE);

  WireClient first(server.port());
  first.greet();
  WireClient second(server.port());
  second.send(hello_message(64, 64, v1::CODEC_H264));
  EXPECT_EQ(second.receive_until_closed(&error).close_code, 1013);
  EXPECT_EQ(error->code(), v1::Error::SERVER_FULL);
}

TEST(Server, ServesScenesWhateverTheirFilesAreCalled) {
  const TemporaryFolder folder;
  const Scene city = synthesize(SynthKind::city, 1000, 1);
  std::string money;
  for (int i = 0; i < 40; ++i) money += "\u20ac";  // 120 bytes: its id is cut between characters
  std::vector<std::string> paths;
  for (const std::string& name : {std::string("b\xe4r"), std::string("b\xf6r"), money}) {
    paths.push_back((folder / (name + ".splat")).string());
    save_scene(city.cloud, paths.back());
  }
  RunningServer server([&](ServerConfig& config) { config.scenes = paths; });
  const auto listed = nlohmann::json::parse(http_get(server.port(), "/api/scenes").body);
  const std::string cut = money.substr(0, 99);
  EXPECT_EQ(listed.at("scenes")[0].at("id"), "b\ufffdr");
  EXPECT_EQ(listed.at("scenes")[1].at("id"), "b\ufffdr-2");
  EXPECT_EQ(listed.at("scenes")[2].at("id"), cut);
  WireClient client(server.port());
  EXPECT_THAT(client.greet().scene_ids(), testing::ElementsAre("b\ufffdr", "b\ufffdr-2", cut));
  EXPECT_TRUE(nlohmann::json::accept(sessions_json(server)));
}

TEST(Server, LimitsConnectionsOfOneAddress) {
  RunningServer server([](ServerConfig& config) { config.max_sessions_per_address = 1; });
  WireClient first(server.port());
  first.greet();
  WireClient second(server.port());
  std::optional<v1::Error> error;
  second.receive_until_closed(&error);
  ASSERT_TRUE(error);
  EXPECT_EQ(error->code(), v1::Error::SERVER_FULL);
}

TEST(Server, LimitsTheAddressesBehindAProxy) {
  const auto one_each = [](ServerConfig& config) { config.max_sessions_per_address = 1; };
  const auto via_proxy = [](const std::string& client) {
    return WireClient::Options{.origin = "", .forwarded_for = client};
  };
  const auto refused = [](WireClient& client) {
    client.send(hello_message(64, 64, v1::CODEC_H264));
    for (;;) {
      const Received received = client.receive();
      if (received.closed) return true;
      if (received.message && received.message->has_welcome()) return false;
    }
  };
  RunningServer behind([&](ServerConfig& config) {
    one_each(config);
    config.trusted_proxies = {"127.0.0.0/8"};
  });
  WireClient a(behind.port(), via_proxy("198.51.100.1"));
  WireClient b(behind.port(), via_proxy("198.51.100.2"));
  WireClient c(behind.port(), via_proxy("198.51.100.9, 198.51.100.1"));
  EXPECT_FALSE(refused(a));
  EXPECT_FALSE(refused(b)) << "another visitor of the same proxy";
  EXPECT_TRUE(refused(c)) << "what the visitor made up counts for nothing";

  RunningServer alone(one_each);
  WireClient d(alone.port(), via_proxy("198.51.100.1"));
  WireClient e(alone.port(), via_proxy("198.51.100.2"));
  EXPECT_FALSE(refused(d));
  EXPECT_TRUE(refused(e)) << "nobody is believed unasked";
}

TEST(Server, RefusesForeignOriginsAndProtocols) {
  RunningServer server(
      [](ServerConfig& config) { config.allow_origins = {"https://friend.example"}; });
  const std::string own = "http://127.0.0.1:" + std::to_string(server.port());
  EXPECT_NO_THROW(WireClient(server.port(), {own, "catgs.v1"}));
  EXPECT_NO_THROW(WireClient(server.port(), {"https://friend.example", "catgs.v1"}));
  EXPECT_THROW(WireClient(server.port(), {"https://evil.example", "catgs.v1"}),
               boost::system::system_error);
  EXPECT_THROW(WireClient(server.port(), {"", "catgs.v99"}), boost::system::system_error);
  EXPECT_THROW(WireClient(server.port(), {"", ""}), boost::system::system_error);
}

TEST(Server, AnswersNoForeignNameOnALoopbackAddress) {
  // What a page of evil.example sends after its name was made to resolve to 127.0.0.1.
  RunningServer server([](ServerConfig& config) { config.allow_origins = {"https://a.example"}; });
  for (const int port : {server.port(), server.admin_port()}) {
    const HttpReply refused = http_get(port, "/api/scenes", {{"host", "evil.example:8080"}});
    EXPECT_EQ(refused.status, 403);
    EXPECT_THAT(refused.body, HasSubstr("--allow-origin https://evil.example:8080"));
  }
  EXPECT_EQ(http_get(server.port(), "/api/scenes", {{"host", "a.example"}}).status, 200);
  EXPECT_EQ(http_get(server.port(), "/api/scenes", {{"host", "localhost"}}).status, 200);
  const WireClient::Options rebound{"http://evil.example:8080", "catgs.v1", "evil.example:8080"};
  EXPECT_THROW(WireClient(server.port(), rebound), boost::system::system_error);
}

TEST(Server, LinksOpenTheirSceneOnly) {
  const TemporaryFolder folder;
  const auto key_file = folder.write("key", "0123456789abcdef0123456789abcdef\n");
  RunningServer server([&](ServerConfig& config) {
    config.scenes = {"synth:city:2000", "synth:garden:2000"};
    config.token_key_file = key_file.string();
  });
  const std::string link =
      make_link_token({"city", "viewer", 1'000'000'000'000}, read_key_file("", key_file));
  WireClient guest(server.port());
  EXPECT_THAT(guest.greet(64, 64, v1::CODEC_H264, link).scene_ids(), testing::ElementsAre("city"));

  v1::ClientMessage select;
  select.mutable_select_scene()->set_scene_id("garden");
  guest.send(select);
  const auto error = guest.receive_message(v1::ServerMessage::kError).error();
  EXPECT_EQ(error.code(), v1::Error::UNAUTHORIZED);
  EXPECT_FALSE(error.fatal());
  select.mutable_select_scene()->set_scene_id("city");
  guest.send(select);
  EXPECT_EQ(guest.receive_message(v1::ServerMessage::kWelcome).welcome().scene().scene_id(),
            "city");

  const auto scenes = [&](const std::string& token) {
    return http_get(server.port(), "/api/scenes", {{"authorization", "Bearer " + token}});
  };
  EXPECT_THAT(scenes(link).body, AllOf(HasSubstr("\"city\""), Not(HasSubstr("garden"))));
  EXPECT_EQ(scenes("guess").status, 401);
  const HttpReply stranger = http_get(server.port(), "/api/scenes");
  EXPECT_EQ(stranger.status, 401);
  EXPECT_THAT(stranger.body, AllOf(HasSubstr("Bearer"), Not(HasSubstr("city"))));
}

TEST(Server, AdmitsByTokenAndNeverSaysIt) {
  const TemporaryFolder folder;
  const auto token_file = folder.write("tokens", "# museum\nopen-sesame-1\n");
  RunningServer server([&](ServerConfig& config) { config.token_file = token_file.string(); });
  WireClient stranger(server.port());
  stranger.send(hello_message(64, 64, v1::CODEC_H264));
  std::optional<v1::Error> error;
  stranger.receive_until_closed(&error);
  ASSERT_TRUE(error);
  EXPECT_EQ(error->code(), v1::Error::UNAUTHORIZED);

  WireClient guest(server.port());
  guest.greet(64, 64, v1::CODEC_H264, "open-sesame-1");
  EXPECT_THAT(sessions_json(server), Not(HasSubstr("sesame")));
}

TEST(Server, ServesPagesAndNothingElse) {
  const TemporaryFolder folder;
  folder.write("web/index.html", "<!doctype html>");
  folder.write("web/assets/a.wasm", "wasm");
  folder.write("secret.txt", "secret");
  RunningServer server([&](ServerConfig& c) { c.client_dir = (folder / "web").string(); });

  const HttpReply page = http_get(server.port(), "/");
  EXPECT_EQ(page.status, 200);
  EXPECT_EQ(page.body, "<!doctype html>");
  EXPECT_THAT(page.headers.at("content-security-policy"), HasSubstr("default-src 'none'"));
  EXPECT_EQ(page.headers.at("cache-control"), "no-cache");
  const HttpReply asset = http_get(server.port(), "/assets/a.wasm");
  EXPECT_EQ(asset.headers.at("content-type"), "application/wasm");
  EXPECT_THAT(asset.headers.at("cache-control"), HasSubstr("immutable"));
  EXPECT_EQ(http_get(server.port(), "/", {{"if-none-match", page.headers.at("etag")}}).status, 304);

  for (const char* target : {"/../secret.txt", "/assets/../../secret.txt", "/%2e%2e/secret.txt",
                             "/..%2fsecret.txt", "//etc/passwd", "/nowhere"}) {
    const HttpReply reply = http_get(server.port(), target);
    EXPECT_GE(reply.status, 400) << target;
    EXPECT_THAT(reply.body, Not(HasSubstr("secret"))) << target;
  }
  EXPECT_EQ(http_get(server.port(), "/healthz").status, 200);
  EXPECT_EQ(http_get(server.port(), "/readyz").status, 200);
  EXPECT_THAT(http_get(server.port(), "/api/scenes").body, HasSubstr("\"id\":\"city\""));
  EXPECT_EQ(http_get(server.port(), "/metrics").status, 404);
  EXPECT_THAT(http_get(server.admin_port(), "/metrics").body, HasSubstr("catgs_sessions 0"));
}

TEST(Server, ServesTlsWithTheGivenCertificate) {
  const TemporaryFolder folder;
  const auto certificate = folder / "certificate.pem";
  const auto key = folder / "key.pem";
  write_self_signed(certificate, key);
  {
    RunningServer server([&](ServerConfig& config) {
      config.tls_cert = certificate.string();
      config.tls_key = key.string();
    });
    const TlsReply reply = tls_get(server.port(), "/healthz");
    EXPECT_EQ(reply.protocol, "http/1.1");
    EXPECT_THAT(reply.text, testing::StartsWith("HTTP/1.1 200"));
  }
  std::filesystem::remove(key);
  ServerConfig config;
  config.scenes = {"synth:city:2000"};
  config.port = 0;
  config.admin_bind = "off";
  config.tls_cert = certificate.string();
  config.tls_key = key.string();
  try {
    Server keyless(config);
    FAIL() << "a certificate without its key";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("--tls-key"));
  }
}

TEST(Server, TakesARenewedCertificate) {
  const TemporaryFolder folder;
  const auto certificate = folder / "certificate.pem";
  const auto key = folder / "key.pem";
  write_self_signed(certificate, key, 1);
  RunningServer server([&](ServerConfig& config) {
    config.tls_cert = certificate.string();
    config.tls_key = key.string();
  });
  EXPECT_EQ(tls_get(server.port(), "/healthz").serial, 1);
  const auto shown_after = [&](long before) {
    long serial = before;
    for (int looks = 0; serial == before && looks < 100; ++looks) {
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
      serial = tls_get(server.port(), "/healthz").serial;
    }
    return serial;
  };
  write_self_signed(certificate, folder / "other-key.pem", 2);  // not that of --tls-key
  std::this_thread::sleep_for(std::chrono::milliseconds(1500));
  EXPECT_EQ(tls_get(server.port(), "/healthz").serial, 1) << "half a pair changes nothing";
  write_self_signed(certificate, key, 3);
  EXPECT_EQ(shown_after(1), 3);
}

TEST(Server, NamesABusyPort) {
  RunningServer server;
  ServerConfig config;
  config.scenes = {"synth:city:2000"};
  config.port = server.port();
  config.admin_bind = "off";
  try {
    Server second(config);
    FAIL() << "two servers on one port";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr(std::to_string(server.port())));
    EXPECT_THAT(error.what(), HasSubstr("busy"));
  }
}

TEST(Server, TellsClientsWhenItStops) {
  RunningServer server;
  WireClient client(server.port());
  client.greet();
  client.send_pose(1);
  server.stop();
  client.receive_message(v1::ServerMessage::kDrain);
  EXPECT_EQ(client.receive_until_closed().close_code, 1001);
  server.join();
}

TEST(ServerProgram, EndsCleanlyOnSigterm) {
  int ports[2];
  ASSERT_EQ(::pipe(ports), 0);
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    ::dup2(ports[1], STDERR_FILENO);
    ::execl(CATGS_SERVER_PROGRAM, "catgs-server", "--scene", "synth:city:2000", "--port", "0",
            "--admin-bind", "off", "--drain-wait", "1", static_cast<char*>(nullptr));
    ::_exit(127);
  }
  ::close(ports[1]);
  std::string log;
  char buffer[512];
  for (ssize_t n; log.find("Ctrl-C") == std::string::npos &&
                  (n = ::read(ports[0], buffer, sizeof buffer)) > 0;)
    log.append(buffer, static_cast<std::size_t>(n));
  EXPECT_THAT(log, HasSubstr("http://127.0.0.1:"));
  EXPECT_THAT(log, HasSubstr("renderer: CPU"));
  EXPECT_EQ(::kill(child, SIGTERM), 0);
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  EXPECT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 0);
  ::close(ports[0]);
}

}  // namespace
}  // namespace catgs::test

// Integration: real sockets on loopback, a whole server in this process.

#include "server/server.h"

#include <algorithm>
#include <chrono>
#include <set>
#include <thread>

#include <boost/system/system_error.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <nlohmann/json.hpp>
#include <sys/socket.h>
#include <unistd.h>

#include "render_core/base/error.h"
#include "render_core/scene/files/save_scene.h"
#include "render_core/synth/synth.h"
#include "server/base/scene_id.h"
#include "server/encode/decoder.h"
#include "server/net/lws_websocket.h"
#include "tests/render_core/scene/scene_test_support.h"
#include "tests/support/server_client.h"
#include "tests/support/temporary_folder.h"

namespace catgs::test {
namespace {

using testing::HasSubstr;
using testing::Not;

std::string sessions_json(const RunningServer& server) {
  return http_get(server.admin_port(), "/api/sessions").body;
}

TEST(Server, StreamsTheNewestPose) {
  const RunningServer& server = shared_server();
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
  const RunningServer& server = shared_server();
  WireClient client(server.port());
  const auto welcome = client.greet(64, 48, v1::CODEC_MJPEG);
  EXPECT_EQ(welcome.config().codec(), v1::CODEC_MJPEG);
  client.send_pose(1);
  const ReceivedFrame frame = client.receive_frame();
  ASSERT_GE(frame.bitstream.size(), 2u);
  EXPECT_EQ(frame.bitstream[0], std::byte{0xff});
  EXPECT_EQ(frame.bitstream[1], std::byte{0xd8});
}

TEST(TuneForFrames, TakesBbrWhereTheKernelOffersIt) {
  const int connection = ::socket(AF_INET, SOCK_STREAM, 0);
  const auto congestion_control = [&] {
    char name[16] = {};
    socklen_t size = sizeof name;
    ::getsockopt(connection, IPPROTO_TCP, TCP_CONGESTION, name, &size);
    return std::string(name);
  };
  const bool offered = ::setsockopt(connection, IPPROTO_TCP, TCP_CONGESTION, "bbr", 3) == 0;
  ::setsockopt(connection, IPPROTO_TCP, TCP_CONGESTION, "reno", 4);
  EXPECT_EQ(congestion_control(), "reno");
  tune_for_frames(connection);
  EXPECT_EQ(congestion_control(), offered ? "bbr" : "reno");
  ::close(connection);
}

TEST(Server, NewSettingsGiveANewConfigAndThenAnIdr) {
  const RunningServer& server = shared_server();
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

// As where a processor keeps up with no more in motion.
TEST(Server, APictureAtRestHasItsOwnSize) {
  const RunningServer& server = shared_server();
  WireClient client(server.port());
  client.greet(160, 96);
  v1::ClientMessage settings;
  settings.mutable_settings()->set_width_px(160);
  settings.mutable_settings()->set_height_px(96);
  settings.mutable_settings()->set_still_width_px(640);
  settings.mutable_settings()->set_still_height_px(384);
  client.send(settings);
  std::uint64_t pose = 1;
  client.send_pose(pose);
  std::uint32_t told_px = 160;
  DecodedPicture picture;
  for (int stills = 0; stills < 3;) {
    const Received received = client.receive();
    ASSERT_FALSE(received.closed);
    if (received.message && received.message->has_config())
      told_px = received.message->config().width_px();
    if (!received.frame) continue;
    const v1::FrameHeader& header = received.frame->header;
    client.send_ack(header.frame_id());
    EXPECT_EQ(header.width_px(), header.still() ? 640u : 160u);
    EXPECT_EQ(header.width_px(), told_px) << "before the first frame of that size";
    if (!header.still() || header.pose_id() != pose || !header.idr()) continue;
    Decoder decoder(Codec::h264);
    ASSERT_TRUE(decoder.decode(received.frame->bitstream, picture).ok);
    ++stills;
    ++pose;
    client.send_pose(pose, 0.1f * static_cast<float>(pose));
  }
  EXPECT_EQ(picture.size_px, glm::ivec2(640, 384));
}

TEST(Server, AClaimOfAClientSpoilsNoMetric) {
  RunningServer server;
  WireClient client(server.port());
  client.greet(160, 96);
  client.send_pose(1);
  v1::ClientMessage lie;
  v1::Ack& ack = *lie.mutable_ack();
  ack.set_frame_id(client.receive_frame().header.frame_id());
  ack.set_presented_us(1);
  ack.set_pose_age_us(4'000'000'000);
  for (int i = 0; i < 50; ++i) client.send(lie);  // one frame was shown once
  ack.set_frame_id(1'000'000);
  client.send(lie);
  ack.set_dropped(true);
  client.send(lie);
  v1::ClientMessage bye;
  bye.mutable_bye();
  client.send(bye);
  client.receive_until_closed();
  const std::string metrics = http_get(server.admin_port(), "/metrics").body;
  EXPECT_THAT(metrics, HasSubstr("catgs_motion_to_photon_seconds_count 1\n"));
  EXPECT_THAT(metrics, HasSubstr("catgs_motion_to_photon_seconds_sum 10\n"));
  EXPECT_THAT(metrics, HasSubstr("catgs_frames_dropped_total{by=\"client\"} 0\n"));
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
  const RunningServer& server = shared_server();
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
  const RunningServer& server = shared_server();
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
  const RunningServer& server = shared_server();
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
  std::vector<std::string> ids, names;
  for (const auto& scene : listed.at("scenes")) {
    ids.push_back(scene.at("id"));
    names.emplace_back(name_in(ids.back()));
  }
  EXPECT_THAT(names, testing::UnorderedElementsAre("b\ufffdr", "b\ufffdr", money.substr(0, 99)));
  EXPECT_EQ(std::set<std::string>(ids.begin(), ids.end()).size(), 3u);
  WireClient client(server.port());
  EXPECT_THAT(client.greet().scene_ids(), testing::ElementsAreArray(ids));
  EXPECT_TRUE(nlohmann::json::accept(sessions_json(server)));
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
  const HttpReply same = http_get(server.port(), "/", {{"if-none-match", page.headers.at("etag")}});
  EXPECT_EQ(same.status, 304);
  EXPECT_EQ(same.headers.count("content-length"), 0u) << "it would be that of the page";

  for (const char* target : {"/../secret.txt", "/assets/../../secret.txt", "/%2e%2e/secret.txt",
                             "/..%2fsecret.txt", "//etc/passwd", "/nowhere"}) {
    const HttpReply reply = http_get(server.port(), target);
    EXPECT_GE(reply.status, 400) << target;
    EXPECT_THAT(reply.body, Not(HasSubstr("secret"))) << target;
  }
  for (const int port : {server.port(), server.admin_port()}) {
    EXPECT_EQ(http_get(port, "/healthz").status, 200);
    EXPECT_EQ(http_get(port, "/readyz").status, 200);
  }
  EXPECT_THAT(http_get(server.port(), "/api/scenes").body, HasSubstr("\"id\":\"city\""));
  EXPECT_EQ(http_get(server.port(), "/metrics").status, 404);
  EXPECT_THAT(http_get(server.admin_port(), "/metrics").body, HasSubstr("catgs_sessions 0"));
}

TEST(Server, NamesABusyPort) {
  const RunningServer& server = shared_server();
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

TEST(Server, HasAPosterAndToursOfEachScene) {
  const RunningServer& server = shared_server();
  const HttpReply poster = http_get(server.port(), "/api/scenes/city/poster.jpg");
  EXPECT_EQ(poster.status, 200);
  EXPECT_THAT(poster.body, testing::StartsWith("\xff\xd8\xff"));
  EXPECT_GT(poster.body.size(), 2000u);
  const HttpReply tours = http_get(server.port(), "/api/scenes/city/tours");
  EXPECT_EQ(tours.status, 200);
  EXPECT_TRUE(nlohmann::json::parse(tours.body).is_object());
  for (const char* path :
       {"/api/scenes/atlantis/tours", "/api/scenes/atlantis/poster.jpg",
        "/api/scenes/atlantis/walk", "/api/scenes//tours", "/api/scenes/city/secrets"})
    EXPECT_EQ(http_get(server.port(), path).status, 404) << path;
}

TEST(Server, SaysThatNobodyWalksWithoutAWord) {
  const TemporaryFolder folder;
  save_scene(random_cloud(300, 0), folder / "dust.ply");
  RunningServer server(
      [&](ServerConfig& config) { config.scenes = {(folder / "dust.ply").string()}; });
  HttpReply ground;
  ASSERT_TRUE(eventually([&] {
    ground = http_get(server.port(), "/api/scenes/dust/walk");
    return ground.status != 202;
  }));
  EXPECT_EQ(ground.status, 204);
  EXPECT_EQ(ground.headers.count("content-length"), 0u);
  EXPECT_EQ(ground.headers.count("content-type"), 0u);
}

TEST(Server, FindsWherePeopleWalkWhenAPageAsks) {
  RunningServer server;
  const auto ask = [&](const std::map<std::string, std::string>& headers = {}) {
    return http_get(server.port(), "/api/scenes/city/walk", headers);
  };
  HttpReply ground = ask();
  EXPECT_EQ(ground.status, 202);
  EXPECT_EQ(ground.headers.at("retry-after"), "3");
  for (int i = 0; i < 2400 && ground.status == 202; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    ground = ask();
  }
  ASSERT_EQ(ground.status, 200);
  EXPECT_THAT(ground.body, testing::StartsWith("catgswlk"));
  EXPECT_EQ(ground.headers.at("content-type"), "application/octet-stream");
  EXPECT_EQ(ask({{"if-none-match", ground.headers.at("etag")}}).status, 304);
}

}  // namespace
}  // namespace catgs::test

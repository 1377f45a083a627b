// Integration: real sockets on loopback, a whole server in this process.

#include "server/server.h"

#include <netinet/in.h>
#include <netinet/tcp.h>
#include <nlohmann/json.hpp>
#include <sys/socket.h>
#include <unistd.h>

#include "render_core/scene/files/save_scene.h"
#include "server/encode/decoder.h"
#include "server/net/lws_websocket.h"
#include "tests/render_core/scene/scene_test_support.h"
#include "tests/server/net/suite_server.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/test.h"

namespace catgs::test {
namespace {

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
  client.send(bye_message());
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
  client.send(bye_message());
  client.receive_until_closed();
  const std::string metrics = http_get(server.admin_port(), "/metrics").body;
  EXPECT_THAT(metrics, HasSubstr("catgs_motion_to_photon_seconds_count 1\n"));
  EXPECT_THAT(metrics, HasSubstr("catgs_motion_to_photon_seconds_sum 10\n"));
  EXPECT_THAT(metrics, HasSubstr("catgs_frames_dropped_total{by=\"client\"} 0\n"));
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
  EXPECT_THAT(refusal(server.port(), pose_message(1, 0.0f)).message(), HasSubstr("hello"));
}

TEST(Server, ServesPagesAndNothingElse) {
  const TemporaryFolder folder;
  folder.write("web/index.html", "<!doctype html>");
  folder.write("web/assets/a.wasm", "wasm");
  RunningServer server([&](ServerConfig& c) { c.client_dir = (folder / "web").string(); });

  const HttpReply page = http_get(server.port(), "/");
  EXPECT_EQ(page.status, 200);
  EXPECT_EQ(page.body, "<!doctype html>");
  EXPECT_EQ(page.headers.at("cache-control"), "no-cache");
  const HttpReply asset = http_get(server.port(), "/assets/a.wasm");
  EXPECT_EQ(asset.headers.at("content-type"), "application/wasm");
  EXPECT_THAT(asset.headers.at("cache-control"), HasSubstr("immutable"));
  const HttpReply same = http_get(server.port(), "/", {{"if-none-match", page.headers.at("etag")}});
  EXPECT_EQ(same.status, 304);
  EXPECT_EQ(same.headers.count("content-length"), 0u) << "it would be that of the page";
  EXPECT_EQ(http_get(server.port(), "/nowhere").status, 404);
  for (const int port : {server.port(), server.admin_port()})
    for (const char* probe : {"/healthz", "/readyz"}) EXPECT_EQ(http_get(port, probe).status, 200);
  EXPECT_THAT(http_get(server.port(), "/api/scenes").body, HasSubstr("\"id\":\"city\""));
  EXPECT_EQ(http_get(server.port(), "/metrics").status, 404);
  EXPECT_THAT(http_get(server.admin_port(), "/metrics").body, HasSubstr("catgs_sessions 0"));
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
  EXPECT_THAT(poster.body, StartsWith("\xff\xd8\xff"));
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
  HttpReply walkable_area;
  ASSERT_TRUE(eventually([&] {
    walkable_area = http_get(server.port(), "/api/scenes/dust/walk");
    return walkable_area.status != 202;
  }));
  EXPECT_EQ(walkable_area.status, 204);
  EXPECT_EQ(walkable_area.headers.count("content-length"), 0u);
  EXPECT_EQ(walkable_area.headers.count("content-type"), 0u);
}

TEST(Server, FindsWherePeopleWalkWhenAPageAsks) {
  const RunningServer server;
  const auto ask = [&](const std::map<std::string, std::string>& headers = {}) {
    return http_get(server.port(), "/api/scenes/city/walk", headers);
  };
  HttpReply walkable_area = ask();
  EXPECT_EQ(walkable_area.status, 202);
  EXPECT_EQ(walkable_area.headers.at("retry-after"), "3");
  for (int i = 0; i < 2400 && walkable_area.status == 202; ++i) {
    std::this_thread::sleep_for(50ms);
    walkable_area = ask();
  }
  ASSERT_EQ(walkable_area.status, 200);
  EXPECT_THAT(walkable_area.body, StartsWith("catgswlk"));
  EXPECT_EQ(walkable_area.headers.at("content-type"), "application/octet-stream");
  EXPECT_EQ(ask({{"if-none-match", walkable_area.headers.at("etag")}}).status, 304);
}

}  // namespace
}  // namespace catgs::test

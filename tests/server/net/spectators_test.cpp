// Integration: clients that look on at a session, or follow it. Real sockets on loopback, a whole
// server in this process.

#include <nlohmann/json.hpp>

#include "tests/server/net/suite_server.h"
#include "tests/support/test.h"

namespace catgs::test {
namespace {

v1::ClientMessage watching_hello(const std::string& watch_token, const std::string& token = {}) {
  v1::ClientMessage message = hello_by(token);
  message.mutable_hello()->set_watch(watch_token);
  return message;
}

/// A server that visitors enter by links. Each case has a scene of its own.
const RunningServer& server_of_links() {
  static auto& server = *new SuiteServer([](ServerConfig& config) {
    config.scenes = {"synth:city:2000", "synth:garden:2000", "synth:stress:2000"};
    config.token_key_file = link_key_file();
    config.min_fps = 0;
  });
  return server.get();
}

void present_no_more(WireClient& host) {
  v1::ClientMessage message;
  message.mutable_present()->set_on(false);
  host.send(message);
}

void follow(WireClient& client, const std::string& watch_token) {
  v1::ClientMessage message;
  message.mutable_follow()->set_watch(watch_token);
  client.send(message);
}

/// Skips to a message about the leader that is as wanted.
template <typename Wanted>
v1::Lead lead_of(WireClient& client, Wanted wanted) {
  for (;;) {
    const v1::Lead lead = client.receive_message(v1::ServerMessage::kLead).lead();
    if (wanted(lead)) return lead;
  }
}

/// A host that reads, acknowledges and, when asked, moves.
class BusyHost {
 public:
  explicit BusyHost(const RunningServer& server) : client_(server.port()) {
    welcome = client_.greet(160, 96);
    client_.present();
    client_.send_pose(1);
  }
  void run(const std::stop_token& stop) {
    for (std::uint64_t pose = 2; !stop.stop_requested();) {
      const Received received = client_.receive();  // a heartbeat at least
      if (received.frame) {
        seen[received.frame->header.frame_id()] = received.frame->bitstream;
        client_.send_ack(received.frame->header.frame_id());
      }
      if (!moves) continue;
      client_.send_pose(pose, 0.1f * static_cast<float>(pose));
      ++pose;
    }
    client_.close(1001);
  }

  v1::Welcome welcome;
  std::map<std::uint64_t, std::vector<std::byte>> seen;
  std::atomic<bool> moves{false};

 private:
  WireClient client_;
};

TEST(Spectators, SeeWhatTheHostSeesInOneEncoding) {
  RunningServer server;
  BusyHost host(server);
  EXPECT_FALSE(host.welcome.watching());
  std::jthread host_thread([&](const std::stop_token& stop) { host.run(stop); });

  WireClient spectator(server.port());
  const v1::Welcome welcome = spectator.greet(watching_hello(host.welcome.watch_token()));
  EXPECT_TRUE(welcome.watching());
  EXPECT_EQ(welcome.session_id(), host.welcome.session_id());
  EXPECT_EQ(welcome.config().width_px(), 160u) << "the host's picture, whatever was requested for";
  EXPECT_EQ(welcome.resume_token(), "") << "the host's secrets stay the host's";
  EXPECT_EQ(welcome.watch_token(), "");
  EXPECT_NE(welcome.scene_pass(), "");
  EXPECT_EQ(host.welcome.scene_pass(), "");

  std::map<std::uint64_t, std::vector<std::byte>> seen;
  const ReceivedFrame first = spectator.receive_frame();
  EXPECT_TRUE(first.header.idr()) << "although the host stands still";
  seen[first.header.frame_id()] = first.bitstream;
  spectator.send_pose(1'000'000, 5.0f);  // moves nothing
  host.moves = true;
  while (seen.size() < 30) {  // never acknowledged: that throttles nobody
    const ReceivedFrame frame = spectator.receive_frame();
    EXPECT_LT(frame.header.pose_id(), 1'000'000u);
    seen[frame.header.frame_id()] = frame.bitstream;
  }
  const auto sessions = nlohmann::json::parse(http_get(server.admin_port(), "/api/sessions").body);
  ASSERT_EQ(sessions.size(), 1u);

  host_thread.request_stop();
  host_thread.join();
  for (const auto& [frame_id, bitstream] : seen)
    if (host.seen.count(frame_id) > 0) {
      EXPECT_EQ(bitstream, host.seen[frame_id]);
    }
  EXPECT_GE(host.seen.count(seen.begin()->first), 1u);
  std::optional<v1::Error> error;
  EXPECT_EQ(spectator.receive_until_closed(&error).close_code, 1000);
  ASSERT_TRUE(error);
  EXPECT_EQ(error->code(), v1::Error::SESSION_ENDED);
}

TEST(Spectators, HearOfNewSettingsAndMayLeave) {
  const RunningServer& server = shared_server();
  WireClient host(server.port());
  const std::string link = host.greet(160, 96).watch_token();
  host.present();
  WireClient spectator(server.port());
  spectator.greet(watching_hello(link));
  host.send_pose(1);
  host.send_ack(host.receive_frame().header.frame_id());
  v1::ClientMessage settings;
  settings.mutable_settings()->set_width_px(320);
  settings.mutable_settings()->set_height_px(180);
  host.send(settings);
  EXPECT_EQ(spectator.receive_message(v1::ServerMessage::kConfig).config().width_px(), 320u);
  spectator.send(bye_message());
  EXPECT_EQ(spectator.receive_until_closed().close_code, 1000);
  ReceivedFrame frame;
  do {  // what sharpened the smaller picture may still come
    frame = host.receive_frame();
    host.send_ack(frame.header.frame_id());
  } while (frame.header.width_px() != 320);
  EXPECT_TRUE(frame.header.idr()) << "the host goes on";
}

TEST(Spectators, AreLimitedAndNeedARealLink) {
  RunningServer server([](ServerConfig& config) { config.max_spectators = 1; });
  WireClient host(server.port());
  const v1::Welcome welcome = host.greet();
  EXPECT_EQ(refusal(server.port(), watching_hello(welcome.watch_token())).code(),
            v1::Error::SESSION_ENDED)
      << "nobody looks on unasked";
  host.present();
  EXPECT_EQ(refusal(server.port(), watching_hello("made.up")).code(), v1::Error::UNAUTHORIZED);
  EXPECT_EQ(refusal(server.port(), watching_hello(welcome.session_id())).code(),
            v1::Error::UNAUTHORIZED);
  EXPECT_EQ(refusal(server.port(), watching_hello(welcome.resume_token())).code(),
            v1::Error::UNAUTHORIZED);
  WireClient first(server.port());
  first.greet(watching_hello(welcome.watch_token()));
  EXPECT_EQ(refusal(server.port(), watching_hello(welcome.watch_token())).code(),
            v1::Error::SERVER_FULL);
  v1::ClientMessage jpeg_only = watching_hello(welcome.watch_token());
  jpeg_only.mutable_hello()->set_decoders(0, v1::CODEC_MJPEG);
  EXPECT_EQ(refusal(server.port(), jpeg_only).code(), v1::Error::NO_COMMON_CODEC);
}

TEST(Spectators, AreRefusedWhereTheTokenForbidsIt) {
  const RunningServer& server = server_of_links();
  const auto link = [](const char* role) { return make_link(role, "city"); };
  WireClient host(server.port());
  const std::string watch = host.greet(hello_by(link("viewer"))).watch_token();
  host.present();
  WireClient guest(server.port());
  v1::ClientMessage by_link = watching_hello(watch);
  by_link.mutable_hello()->set_follow(true);
  const v1::Welcome shown = guest.greet(by_link);
  EXPECT_TRUE(shown.watching()) << "the leader's link lets a guest watch";
  EXPECT_FALSE(shown.may_leave()) << "and no more";
  EXPECT_EQ(refusal(server.port(), watching_hello(watch, link("solo"))).code(),
            v1::Error::UNAUTHORIZED);
  WireClient spectator(server.port());
  EXPECT_TRUE(spectator.greet(watching_hello(watch, link("spectator"))).watching());
  WireClient alone(server.port());
  EXPECT_EQ(alone.greet(hello_by(link("solo"))).watch_token(), "");
}

TEST(Spectators, NobodyWatchesWhoComesBackByALinkThatForbidsIt) {
  const RunningServer& server = server_of_links();
  const auto link = [](const char* role) { return make_link(role, "garden"); };
  WireClient host(server.port());
  const v1::Welcome welcome = host.greet(hello_by(link("viewer")));
  host.present();
  const v1::ClientMessage watching = watching_hello(welcome.watch_token(), link("spectator"));
  WireClient spectator(server.port());
  spectator.greet(watching);
  WireClient alone(server.port());
  v1::ClientMessage back = resuming_hello(welcome.resume_token());
  back.mutable_hello()->set_token(link("solo"));
  const v1::Welcome now = alone.greet(back);
  EXPECT_EQ(now.session_id(), welcome.session_id());
  EXPECT_EQ(now.watch_token(), "");
  EXPECT_EQ(spectator.receive_until_closed().close_code, 1000);
  EXPECT_EQ(refusal(server.port(), watching).code(), v1::Error::UNAUTHORIZED);
}

TEST(Spectators, FindTheLeaderOfTheirScene) {
  const RunningServer& server = server_of_links();
  const auto link = [](const char* role) { return make_link(role, "stress"); };
  WireClient host(server.port());
  const std::string id = host.greet(hello_by(link("viewer"))).session_id();
  const v1::ClientMessage hello = watching_hello("", link("spectator"));
  EXPECT_EQ(refusal(server.port(), hello).code(), v1::Error::NO_LEADER);
  host.present();
  WireClient spectator(server.port());
  const v1::Welcome welcome = spectator.greet(hello);
  EXPECT_TRUE(welcome.watching());
  EXPECT_FALSE(welcome.may_leave());
  EXPECT_EQ(welcome.session_id(), id);
  const auto with_one = [](const v1::Lead& lead) { return lead.company() == 1; };
  EXPECT_EQ(lead_of(spectator, with_one).name(), "Ada");
  EXPECT_EQ(lead_of(host, with_one).state(), v1::Lead::LEADS);
  present_no_more(host);
  std::optional<v1::Error> error;
  EXPECT_EQ(spectator.receive_until_closed(&error).close_code, 1000);
  EXPECT_EQ(error->code(), v1::Error::SESSION_ENDED);
  EXPECT_EQ(refusal(server.port(), hello).code(), v1::Error::NO_LEADER);
}

TEST(Followers, GetTheLeadersCameraAndKeepTheirOwnStream) {
  RunningServer server([](ServerConfig& config) { config.min_fps = 0; });
  WireClient host(server.port());
  const std::string link = host.greet(64, 64, v1::CODEC_H264).watch_token();
  host.present();
  host.send_pose(1, 1.5f);
  WireClient follower(server.port());
  v1::ClientMessage hello = watching_hello(link);
  hello.mutable_hello()->set_follow(true);
  EXPECT_FALSE(follower.greet(hello).watching()) << "a place is free";
  follow(follower, link);
  const auto at = [](float x) {
    return
        [x](const v1::Lead& lead) { return lead.camera().world_from_camera().position().x() == x; };
  };
  EXPECT_EQ(lead_of(follower, at(1.5f)).name(), "Ada");
  host.send_pose(2, 2.5f);
  lead_of(follower, at(2.5f));
  follower.send_pose(7, 9.0f);
  while (follower.receive_frame().header.pose_id() != 7) {
  }
  EXPECT_EQ(lead_of(host, [](const v1::Lead& lead) { return lead.company() == 1; }).company(), 1u);
  follow(follower, "");
  lead_of(host, [](const v1::Lead& lead) { return lead.company() == 0; });
  follow(follower, link);
  follow(host, link);
  EXPECT_EQ(host.receive_message(v1::ServerMessage::kError).error().code(), v1::Error::BAD_MESSAGE)
      << "nobody follows themselves";
  present_no_more(host);
  EXPECT_EQ(lead_of(follower, [](const v1::Lead& lead) { return lead.state() == v1::Lead::ENDED; })
                .company(),
            0u);
  follow(follower, link);
  EXPECT_FALSE(follower.receive_message(v1::ServerMessage::kError).error().fatal());
  EXPECT_EQ(follower.receive_message(v1::ServerMessage::kLead).lead().state(), v1::Lead::ENDED);
}

TEST(Followers, WatchWhereNoPlaceIsFreeAndHearThatTheLeaderIsAway) {
  RunningServer server([](ServerConfig& config) {
    config.min_fps = 0;
    config.max_sessions = 1;
    config.max_spectators = 1;
  });
  auto host = std::make_unique<WireClient>(server.port());
  const v1::Welcome lead = host->greet(64, 64, v1::CODEC_H264);
  host->present();
  v1::ClientMessage hello = watching_hello(lead.watch_token());
  hello.mutable_hello()->set_follow(true);
  WireClient follower(server.port());
  const v1::Welcome welcome = follower.greet(hello);
  EXPECT_TRUE(welcome.watching());
  EXPECT_TRUE(welcome.may_leave()) << "once a place is free";
  EXPECT_EQ(refusal(server.port(), hello).code(), v1::Error::SERVER_FULL);
  host.reset();
  lead_of(follower, [](const v1::Lead& now) { return now.state() == v1::Lead::AWAY; });
  WireClient back(server.port());
  back.greet(resuming_hello(lead.resume_token()));
  lead_of(follower, [](const v1::Lead& now) { return now.state() == v1::Lead::LEADS; });
}

}  // namespace
}  // namespace catgs::test

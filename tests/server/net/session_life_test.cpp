// Integration: what becomes of sessions when sockets are lost, the house is full or the server
// goes. Real sockets on loopback, whole servers in this process.

#include <nlohmann/json.hpp>

#include "tests/server/net/suite_server.h"
#include "tests/support/descriptor_limit.h"
#include "tests/support/test.h"

namespace catgs::test {
namespace {

nlohmann::json sessions(const RunningServer& server) {
  return nlohmann::json::parse(http_get(server.admin_port(), "/api/sessions").body);
}

TEST(SessionLifeOnSockets, ALostSocketFindsItsSessionAgain) {
  RunningServer server;
  std::string id;
  std::string token;
  {
    WireClient client(server.port());
    const v1::Welcome welcome = client.greet();
    id = welcome.session_id();
    token = welcome.resume_token();
    EXPECT_FALSE(token.empty());
    client.send_pose(1);
    client.send_ack(client.receive_frame().header.frame_id());
  }
  ASSERT_TRUE(eventually([&] { return metric(server, "catgs_sessions_lost") == 1; }));
  EXPECT_EQ(sessions(server)[0].at("state"), "lost");

  WireClient again(server.port());
  const v1::Welcome welcome = again.greet(resuming_hello(token, 2));
  EXPECT_EQ(welcome.session_id(), id);
  const ReceivedFrame first = again.receive_frame();
  EXPECT_TRUE(first.header.idr());
  EXPECT_GT(first.header.frame_id(), 1u) << "the session goes on";
  EXPECT_EQ(first.header.pose_id(), 2u) << "at the pose of the hello";
  again.send_ack(first.header.frame_id());
  for (std::uint64_t pose = 3; pose < 8; ++pose) {
    again.send_pose(pose, 0.1f * static_cast<float>(pose));
    const ReceivedFrame next = again.receive_frame();
    EXPECT_FALSE(next.header.idr()) << "one IDR is enough";
    again.send_ack(next.header.frame_id());
  }
  EXPECT_EQ(metric(server, "catgs_sessions"), 1);
  EXPECT_EQ(metric(server, "catgs_sessions_resumed_total"), 1);
}

TEST(SessionLifeOnSockets, ASecondSocketTakesTheSessionOver) {
  RunningServer server;
  WireClient first(server.port());
  const v1::Welcome welcome = first.greet();
  WireClient second(server.port());
  EXPECT_EQ(second.greet(resuming_hello(welcome.resume_token())).session_id(),
            welcome.session_id());
  EXPECT_EQ(first.receive_until_closed().close_code, 1001);
  second.send_pose(1);
  EXPECT_TRUE(second.receive_frame().header.idr());
  EXPECT_TRUE(eventually([&] { return metric(server, "catgs_connections") == 1; }));
  EXPECT_TRUE(eventually([&] { return sessions(server).size() == 1; }));
}

TEST(SessionLifeOnSockets, AClientThatSaysGoodbyeIsNotWaitedFor) {
  RunningServer server;
  WireClient polite(server.port());
  polite.greet();
  WireClient closed_page(server.port());
  closed_page.greet();
  ASSERT_TRUE(eventually([&] { return sessions(server).size() == 2; }));
  polite.send(bye_message());
  polite.receive_until_closed();
  closed_page.close(1001);
  ASSERT_TRUE(eventually([&] { return sessions(server).empty(); }));
  EXPECT_EQ(metric(server, "catgs_sessions"), 0);
}

void in_fleet(ServerConfig& config) { config.resume_key_file = link_key_file(); }

TEST(SessionLifeOnSockets, AResumeTokenOpensNoDoorByItself) {
  RunningServer server([&](ServerConfig& config) { config.token_file = static_token_file(); });
  WireClient guest(server.port());
  const v1::Welcome welcome = guest.greet(hello_by(static_token));
  EXPECT_EQ(refusal(server.port(), resuming_hello(welcome.resume_token())).code(),
            v1::Error::UNAUTHORIZED);
  guest.send_pose(1);
  EXPECT_TRUE(guest.receive_frame().header.idr()) << "the guest was not disturbed";
}

TEST(SessionLifeOnSockets, WaitsInLineForAPlace) {
  RunningServer server([](ServerConfig& config) {
    config.max_sessions = 1;
    config.max_queue = 2;
  });
  auto host = std::make_unique<WireClient>(server.port());
  host->greet();
  std::vector<std::unique_ptr<WireClient>> waiting;
  for (std::uint32_t position = 1; position <= 2; ++position) {
    waiting.push_back(std::make_unique<WireClient>(server.port()));
    waiting.back()->send(hello_message(160, 96, v1::CODEC_H264));
    const auto queue = waiting.back()->receive_message(v1::ServerMessage::kQueue).queue();
    EXPECT_EQ(queue.position(), position);
    EXPECT_GT(queue.estimate_s(), 0u);
  }
  WireClient refused(server.port());
  refused.send(hello_message(160, 96, v1::CODEC_H264));
  std::optional<v1::Error> error;
  EXPECT_EQ(refused.receive_until_closed(&error).close_code, 1013);
  ASSERT_TRUE(error);
  EXPECT_EQ(error->code(), v1::Error::SERVER_FULL);

  host->close(1001);
  waiting[0]->receive_message(v1::ServerMessage::kWelcome);
  for (std::uint32_t position = 2; position != 1;)
    position = waiting[1]->receive_message(v1::ServerMessage::kQueue).queue().position();
  waiting[0]->send_pose(1);
  EXPECT_TRUE(waiting[0]->receive_frame().header.idr());
  waiting[0]->close(1001);
  waiting[1]->receive_message(v1::ServerMessage::kWelcome);
}

TEST(SessionLifeOnSockets, AClientThatGivesUpWaitingMakesRoom) {
  RunningServer server([](ServerConfig& config) {
    config.max_sessions = 1;
    config.max_queue = 1;
  });
  WireClient host(server.port());
  host.greet();
  {
    WireClient impatient(server.port());
    impatient.send(hello_message(160, 96, v1::CODEC_H264));
    impatient.receive_message(v1::ServerMessage::kQueue);
  }
  ASSERT_TRUE(eventually([&] { return metric(server, "catgs_sessions_waiting") == 0; }));
  WireClient next(server.port());
  next.send(hello_message(160, 96, v1::CODEC_H264));
  EXPECT_EQ(next.receive_message(v1::ServerMessage::kQueue).queue().position(), 1u);
}

/// Frames of a camera that moves, acknowledged one by one. Returns how many were of motion: on a
/// slow machine a pose comes so late that there was a still before it.
int stream(WireClient& client, std::uint64_t frames) {
  int in_motion = 0;
  for (std::uint64_t pose = 1; pose <= frames; ++pose) {
    client.send_pose(pose, 0.05f * static_cast<float>(pose));
    const auto header = client.receive_frame().header;
    client.send_ack(header.frame_id());
    in_motion += header.still() ? 0 : 1;
  }
  return in_motion;
}

TEST(SessionLifeOnSockets, TellsWhatASessionTakesAndWhereItsTimeGoes) {
  RunningServer server;
  WireClient client(server.port());
  const std::string id = client.greet(320, 180).session_id();
  const int in_motion = stream(client, 20);
  ASSERT_GT(in_motion, 0);
  ASSERT_TRUE(eventually([&] { return sessions(server)[0].at("frames_sent") >= 20; }));
  const auto session = sessions(server)[0];
  EXPECT_EQ(session.at("id"), id);
  EXPECT_GT(session.at("cpu_seconds"), 0.0);
  EXPECT_EQ(session.at("gpu_seconds"), 0.0);
  EXPECT_GT(session.at("bytes_sent"), 0);
  for (const char* time :
       {"queue_wait", "render", "encode", "send", "pose_to_frame", "motion_to_photon"}) {
    const auto& percentiles = session.at("times_ms").at(time);
    EXPECT_LE(percentiles.at("p50"), percentiles.at("p95")) << time;
    EXPECT_LE(percentiles.at("p95"), percentiles.at("p99")) << time;
  }
  EXPECT_GT(session.at("times_ms").at("render").at("p50"), 0.0);
  EXPECT_GE(session.at("times_ms").at("pose_to_frame").at("p50"),
            session.at("times_ms").at("render").at("p50"));

  const std::string metrics = http_get(server.admin_port(), "/metrics").body;
  for (const char* stage : {"queue_wait", "hand_off", "render", "encode_wait", "encode", "send"})
    EXPECT_THAT(metrics,
                HasSubstr("catgs_frame_stage_seconds_count{stage=\"" + std::string(stage) + "\"}"));
  EXPECT_GE(metric(server, "catgs_pose_to_frame_seconds_count"), in_motion);
  EXPECT_EQ(metric(server, "catgs_motion_to_photon_seconds_count"), 20);
  EXPECT_THAT(metrics, Not(HasSubstr(id))) << "no label names a session";
}

TEST(SessionLifeOnSockets, LostSessionsCountForTheirAddress) {
  RunningServer server([](ServerConfig& config) { config.max_sessions_per_address = 1; });
  std::string token;
  {
    WireClient client(server.port());
    token = client.greet().resume_token();
  }
  ASSERT_TRUE(eventually([&] { return metric(server, "catgs_sessions_lost") == 1; }));
  EXPECT_EQ(refusal(server.port(), hello_by("")).code(), v1::Error::SERVER_FULL);
  ASSERT_TRUE(eventually([&] { return metric(server, "catgs_connections") == 0; }));
  WireClient back(server.port());
  EXPECT_NO_THROW(back.greet(resuming_hello(token)));
}

TEST(SessionLifeOnSockets, FramesGoOnUntilTheClientHasMoved) {
  RunningServer old_server(in_fleet);
  RunningServer new_server(in_fleet);
  WireClient old_link(old_server.port());
  const v1::Welcome welcome = old_link.greet();
  old_link.send_pose(1);
  old_link.send_ack(old_link.receive_frame().header.frame_id());
  old_server.stop();
  EXPECT_GT(old_link.receive_message(v1::ServerMessage::kDrain).drain().deadline_ms(), 0u);
  EXPECT_EQ(http_get(old_server.port(), "/readyz").status, 503);
  WireClient newcomer(old_server.port());
  std::optional<v1::Error> error;
  EXPECT_EQ(newcomer.receive_until_closed(&error).close_code, 1012);
  EXPECT_FALSE(error) << "the server is not full";
  old_link.send_pose(2, 0.2f);
  EXPECT_EQ(old_link.receive_frame().header.pose_id(), 2u);

  WireClient new_link(new_server.port());
  EXPECT_EQ(new_link.greet(resuming_hello(welcome.resume_token(), 3)).session_id(),
            welcome.session_id());
  const auto first = new_link.receive_frame().header;
  EXPECT_TRUE(first.idr());
  EXPECT_EQ(first.pose_id(), 3u);
  WireClient elsewhere(shared_server().port());
  EXPECT_NE(elsewhere.greet(resuming_hello(welcome.resume_token(), 9)).session_id(),
            welcome.session_id())
      << "a server of another key";
  EXPECT_EQ(elsewhere.receive_frame().header.pose_id(), 9u) << "the pose is the client's own";
  old_link.send(bye_message());
  EXPECT_EQ(old_link.receive_until_closed().close_code, 1000);
  old_server.join();  // nobody is left, so it does not wait for the deadline
}

TEST(SessionLifeOnSockets, NothingLeaksOverManyLossesAndReturns) {
  constexpr int cycles = 500;
  RunningServer server;
  auto client = std::make_unique<WireClient>(server.port());
  v1::Welcome welcome = client->greet();
  const std::string id = welcome.session_id();
  const auto one_connection = [&] { return metric(server, "catgs_connections") == 1; };
  ASSERT_TRUE(eventually(one_connection));
  const auto descriptors = open_descriptors();
  for (int i = 1; i <= cycles; ++i) {
    client =
        std::make_unique<WireClient>(server.port());  // drops the one before, half of them late
    welcome = client->greet(resuming_hello(welcome.resume_token(), static_cast<unsigned>(i)));
    ASSERT_EQ(welcome.session_id(), id) << "cycle " << i;
    const ReceivedFrame frame = client->receive_frame();
    ASSERT_TRUE(frame.header.idr());
    client->send_ack(frame.header.frame_id());
  }
  ASSERT_TRUE(eventually(one_connection));
  EXPECT_TRUE(eventually([&] { return sessions(server).size() == 1; }));
  EXPECT_EQ(metric(server, "catgs_sessions"), 1);
  EXPECT_EQ(metric(server, "catgs_sessions_admitted_total"), 1);
  EXPECT_EQ(metric(server, "catgs_sessions_resumed_total"), cycles);
  // The request before may not be closed yet at the server's end.
  EXPECT_TRUE(eventually([&] { return open_descriptors() <= descriptors; }))
      << open_descriptors() << " descriptors, " << descriptors << " before";
}

}  // namespace
}  // namespace catgs::test

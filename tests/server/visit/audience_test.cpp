#include "server/visit/audience.h"

#include <fmt/format.h>

#include "tests/server/visit/sessions_fixture.h"

namespace catgs::test {
namespace {

class AudienceTest : public testing::Test {
 protected:
  std::shared_ptr<OpenConnection> join() {
    auto connection = std::make_shared<OpenConnection>();
    spectators.push_back(std::make_shared<ClientConnection>(io, metrics, connection, [] {}));
    audience.add(spectators.back(), Welcome{});
    return connection;
  }
  void frame(std::uint64_t id, bool idr = false) {
    OutgoingFrame outgoing;
    outgoing.ticket.frame_id = id;
    outgoing.ticket.idr = idr;
    audience.send(outgoing, now);
  }

  void keep_talking(TimePoint at) {
    audience.keep_talking(at, [this](const std::string& scene_id) {
      return fmt::format("pass {} to {}", ++passes, scene_id);
    });
  }

  int passes = 0;  // signed
  TimePoint now = TimePoint{} + 1h;
  boost::asio::io_context io;
  Metrics metrics;
  Audience audience{2, "192.0.2.2"};
  std::vector<std::shared_ptr<ClientConnection>> spectators;
};

TEST_F(AudienceTest, FramesBeginWithAnIdr) {
  const auto spectator = join();
  EXPECT_EQ(spectator->messages, 1) << "the welcome";
  EXPECT_TRUE(audience.wants_idr(now));
  frame(1);
  EXPECT_TRUE(spectator->frames.empty()) << "nothing that it could decode";
  frame(2, true);
  frame(3);
  EXPECT_EQ(spectator->frames, (std::vector<std::uint64_t>{2, 3}));
  EXPECT_FALSE(audience.wants_idr(now + 1h));
}

TEST_F(AudienceTest, APresentationEndsWithItsScene) {
  const auto enter = [&](const std::string& scene_id) {
    Welcome welcome;
    welcome.scene.scene_id = scene_id;
    audience.send(welcome, now);
  };
  enter("hall");
  audience.tour().begin({true, "Ada"}, now);
  const auto spectator = join();
  enter("hall");  // the leader comes back
  EXPECT_TRUE(audience.tour().since());
  EXPECT_FALSE(spectator->closed);
  enter("attic");
  EXPECT_FALSE(audience.tour().since());
  EXPECT_TRUE(spectator->closed) << "it may not be allowed to see that";
}

TEST_F(AudienceTest, FollowersHearOfACameraThirtyTimesASecondAtMost) {
  const auto connection = std::make_shared<OpenConnection>();
  const auto follower = std::make_shared<ClientConnection>(io, metrics, connection, [] {});
  audience.tour().begin({true, "Ada"}, now);
  audience.tour().add(follower);
  const auto told = [&](bool at_rest) {
    const int before = connection->messages;
    PoseSample camera;
    camera.at_rest = at_rest;
    for (int i = 0; i < 100; ++i) audience.tour().moved(camera, now += 10us);
    return connection->messages - before;
  };
  EXPECT_EQ(told(false), 1);
  EXPECT_EQ(told(true), 1) << "that it stops";
  now += 1s;
  EXPECT_EQ(told(true), 1);
  // It rests and moves in turns, as often as a connection may send.
  const int before = connection->messages;
  for (int i = 0; i < 600; ++i) {
    PoseSample camera;
    camera.at_rest = i % 2 == 0;
    audience.tour().moved(camera, now += 1667us);
  }
  EXPECT_LE(connection->messages - before, 32);
}

TEST_F(AudienceTest, ASlowOneDropsToTheNextIdrAndDisturbsNobody) {
  const auto good = join();
  const auto slow = join();
  EXPECT_TRUE(audience.full());
  frame(1, true);
  slow->full = true;
  frame(2);
  slow->full = false;
  frame(3);
  EXPECT_EQ(slow->frames, (std::vector<std::uint64_t>{1}));
  EXPECT_EQ(good->frames, (std::vector<std::uint64_t>{1, 2, 3}));
  EXPECT_FALSE(audience.wants_idr(now + 999ms)) << "an IDR a second at most, whoever waits";
  EXPECT_TRUE(audience.wants_idr(now + 1s));
  now += 1s;
  frame(4, true);
  frame(5);
  EXPECT_EQ(slow->frames, (std::vector<std::uint64_t>{1, 4, 5}));
}

TEST_F(AudienceTest, ALostDecoderAsksForItself) {
  const auto spectator = join();
  frame(1, true);
  audience.on_message(*spectators[0], RequestIdr{});
  frame(2);
  EXPECT_EQ(spectator->frames, (std::vector<std::uint64_t>{1}));
  EXPECT_TRUE(audience.wants_idr(now + 1s));
}

TEST_F(AudienceTest, IsNeverSilentForLong) {
  const auto spectator = join();
  for (auto waited = 0ms; waited < 10s; waited += 250ms) keep_talking(now + waited);
  EXPECT_GE(spectator->messages, 1 + 10);
  EXPECT_LE(spectator->messages, 1 + 14);
}

TEST_F(AudienceTest, SpectatorsOfALongTourGetANewPassEachHour) {
  Welcome welcome;
  welcome.scene.scene_id = "hall";
  audience.send(welcome, now);
  audience.tour().begin({true, "Ada"}, now);
  const auto spectator = join();
  keep_talking(now);
  EXPECT_EQ(spectator->lead->scene_pass(), "");
  keep_talking(now + 59min);
  EXPECT_EQ(passes, 0);
  for (auto later = 60min; later < 180min; later += 5min) keep_talking(now + later);
  EXPECT_EQ(passes, 2);
  EXPECT_EQ(spectator->lead->scene_pass(), "pass 2 to hall");
  EXPECT_EQ(spectator->lead->name(), "Ada") << "the message is whole";
  EXPECT_EQ(spectator->lead->company(), 1u);
}

TEST_F(AudienceTest, EndsWithTheSession) {
  const auto first = join();
  const auto second = join();
  audience.remove(*spectators[0]);
  EXPECT_EQ(audience.spectators(), 1u);
  audience.end_tour();
  EXPECT_EQ(second->closed, CloseCode::normal);
  EXPECT_FALSE(first->closed);
  EXPECT_EQ(audience.spectators(), 0u);
}

}  // namespace
}  // namespace catgs::test

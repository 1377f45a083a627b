// Who gets which device and which encoder, and who is refused.

#include <set>
#include <sstream>

#include <spdlog/spdlog.h>

#include "server/base/log.h"
#include "tests/server/visit/places_fixture.h"

namespace catgs::test {
namespace {

TEST_F(PlacesTest, NewSessionsGoWhereLessWorkIsMeasured) {
  start();
  renderer->frame_ms[0] = 40.0f;
  renderer->frame_ms[1] = 1.0f;
  join();
  join();
  EXPECT_EQ(devices->views(), (std::map<int, int>{{0, 1}, {1, 1}}));
  move_on(60);
  join();
  move_on(60);
  join();
  EXPECT_EQ(devices->views(), (std::map<int, int>{{0, 1}, {1, 3}}))
      << "by their number, one of them would be on device 0";
}

TEST_F(PlacesTest, WhereNvencDoesNotOpenX264Serves) {
  nvenc_limit = 1;
  start();
  EXPECT_EQ(encoder_of(join()), "h264_nvenc");
  EXPECT_EQ(encoder_of(join()), "libx264");
  EXPECT_EQ(metrics.encoders_refused.Value(), 1.0);
  EXPECT_EQ(encoder_of(join()), "libx264");
  EXPECT_EQ(metrics.encoders_refused.Value(), 2.0);
  EXPECT_EQ(encoding.nvenc_open, 1);
  move_on(3);

  leave(0);
  run_until([&] { return encoding.nvenc_open == 0; });
  EXPECT_EQ(encoder_of(join()), "h264_nvenc");
}

TEST_F(PlacesTest, ATokenIsCheckedAsOftenHoweverManyScenesThereAre) {
  int checks = 0;
  authorize = [&](const auto&) {
    ++checks;
    return [](auto scene_id, Use) {
      return scene_id == "secret" ? Refusal("not for you") : std::nullopt;
    };
  };
  start();
  join();
  const int for_one_scene = std::exchange(checks, 0);
  scenes.ids.assign(1000, "another");
  scenes.ids.emplace_back("secret");
  EXPECT_EQ(join().connection->welcome->scene_ids_size(), 1000);
  EXPECT_EQ(checks, for_one_scene);
}

TEST_F(PlacesTest, AddressesOfOneNetworkOfIpv6ShareTheirLimit) {
  options.max_sessions_per_address = 2;
  start();
  const auto admits = [&](const char* from) {
    return join({}, from).connection->welcome.has_value();
  };
  EXPECT_TRUE(admits("2001:db8:1:2::1"));
  EXPECT_TRUE(admits("2001:db8:1:2:ffff::2"));
  ASSERT_FALSE(admits("2001:db8:1:2::3"));
  EXPECT_THAT(clients.back().connection->error->message(),
              testing::HasSubstr("from 2001:db8:1:2::/64 already"));
  EXPECT_TRUE(admits("2001:db8:1:3::1")) << "a neighbour's";
  for (const std::size_t index : {3u, 2u, 0u}) leave(index);
  run_until([&] { return places->connections() == 1; });
  EXPECT_TRUE(admits("2001:db8:1:2::3")) << "who leaves is counted no more";
}

TEST_F(PlacesTest, RefusalsAreThoseOfStrangersInTheLog) {
  const auto before = spdlog::default_logger();
  testing::internal::CaptureStderr();
  set_up_log("human", "info");
  start();
  for (int i = 0; i < 2000; ++i) {
    const auto stranger = places->accept(std::make_shared<OpenConnection>("192.0.2.1"));
    stranger->on_bad_message("binary messages only");
    stranger->on_close(false);
  }
  run_until([&] { return metrics.sessions_refused.Value() == 2000.0; });
  for (int i = 0; i < 300; ++i) spdlog::warn("of somebody else");
  std::istringstream lines(testing::internal::GetCapturedStderr());
  spdlog::drop("catgs-server");
  spdlog::set_default_logger(before);
  int refusals = 0, others = 0;
  for (std::string line; std::getline(lines, line);)
    ++(line.ends_with("of somebody else") ? others : refusals);
  EXPECT_EQ(others, 300);
  EXPECT_GE(refusals, 100);
  EXPECT_LT(refusals, 1000);
}

TEST_F(PlacesTest, SessionsHaveIdsThatNoOtherServerGivesAway) {
  start();
  std::set<std::string> ids;
  for (int i = 0; i < 4; ++i) ids.insert(join().connection->welcome->session_id());
  EXPECT_EQ(ids.size(), 4u);
  EXPECT_THAT(ids, testing::Each(testing::MatchesRegex("[0-9a-f]{32}")));
}

TEST_F(PlacesTest, APictureAtRestIsDrawnAgainWhenPagesCome) {
  start();
  Visitor& visitor = join();
  move(visitor);
  const auto drawn = [&] { return metrics.frames_rendered.Value(); };
  double before = -1.0;
  while (drawn() != before || before == 0.0) {  // until it rests
    before = drawn();
    run_for(300ms);
    acknowledge(visitor);
  }
  renderer->outdated = true;
  run_until([&] { return drawn() > before; });
}

TEST_F(PlacesTest, RefusesConnectionsBeyondAllPlaces) {
  options.max_sessions = 2;
  options.max_spectators = 3;
  options.max_queue = 4;
  options.max_sessions_per_address = 1000;
  start();
  std::vector<std::shared_ptr<OpenConnection>> connections;
  for (int i = 0; i < 2 * (1 + 3) + 4 + 64 + 1; ++i) {
    connections.push_back(std::make_shared<OpenConnection>());
    clients.emplace_back(Visitor{connections.back(), places->accept(connections.back())});
  }
  run_until([&] { return connections.back()->closed.has_value(); });
  EXPECT_EQ(connections.back()->error->code(), v1::Error::SERVER_FULL);
  EXPECT_FALSE(connections[connections.size() - 2]->closed);
}

}  // namespace
}  // namespace catgs::test

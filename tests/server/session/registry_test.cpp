// Who gets which device and which encoder.

#include <set>
#include <sstream>
#include <thread>

#include <spdlog/spdlog.h>

#include "server/log.h"
#include "tests/server/session/registry_fixture.h"

namespace catgs::test {
namespace {

TEST_F(RegistryTest, NewSessionsGoWhereLessWorkIsMeasured) {
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

TEST_F(RegistryTest, WhoFindsNoNvencSessionGetsX264) {
  nvenc_limit = 2;
  start();
  EXPECT_EQ(encoder_of(join()), "h264_nvenc");
  EXPECT_EQ(encoder_of(join()), "h264_nvenc");
  EXPECT_EQ(encoder_of(join()), "libx264");
  EXPECT_EQ(metrics.encoders_refused.Value(), 1.0);
  EXPECT_EQ(encoder_of(join()), "libx264");
  EXPECT_EQ(metrics.encoders_refused.Value(), 1.0) << "learnt: the driver is not asked again";
  EXPECT_EQ(encoding.nvenc_open, 2);
  move_on(3);

  leave(0);
  run_until([&] { return encoding.nvenc_open == 1; });
  EXPECT_EQ(encoder_of(join()), "h264_nvenc");
}

TEST_F(RegistryTest, OrWaitsForOneAsTheOperatorSays) {
  nvenc_limit = 2;
  start({.nvenc_sessions = 2, .queue_for_nvenc = true});
  join();
  join();
  const Visitor& third = join();
  EXPECT_TRUE(third.connection->waits);
  EXPECT_EQ(metrics.encoders_refused.Value(), 0.0);
  const auto connection = third.connection;
  leave(0);
  run_until([&] { return connection->welcome.has_value(); });
  EXPECT_EQ(connection->welcome->config().encoder(), "h264_nvenc");
}

TEST_F(RegistryTest, ABurstWaitsForWhatTheFirstOnesCost) {
  options.min_fps = 10;
  options.cpus = 2;
  start();
  Visitor& first = join();
  Visitor& second = join();
  const Visitor& third = join();
  EXPECT_TRUE(first.connection->welcome && second.connection->welcome);
  EXPECT_TRUE(third.connection->waits);
  EXPECT_FALSE(third.connection->welcome);
  run_until([&] {
    move(first);
    return third.connection->welcome.has_value();
  });
  EXPECT_GE(first.connection->frames.size(), 8u) << "its frames were measured";
}

void wish_for_4k(v1::Hello& hello) {
  hello.set_viewport_width_px(3840);
  hello.set_viewport_height_px(2160);
  hello.mutable_settings()->set_max_fps(240);
}

/// Two GPUs, and as many processors as it takes.
struct MeasuredAdmission : RegistryTest {
  void start(float frame_ms) {
    devices = std::make_shared<DeviceSet>(std::vector<int>{0, 1});
    for (const int device : {0, 1}) devices->add(device);
    renderer = std::make_shared<PretendedRenderer>(devices);
    for (auto& ms : renderer->frame_ms) ms = frame_ms;
    scenes = OneScene(renderer);
    options.min_fps = 10;
    options.cpus = 1000;
    RegistryTest::start();
  }
  /// Until it is known what frames cost.
  void measure() {
    move_until([&] { return metrics.gpu_budget_used.Value() > 0.0; });
  }
};

TEST_F(MeasuredAdmission, WhoWishesForTooManyPixelsGetsFewerAndIsInNobodysWay) {
  start(20.0f);
  join();
  measure();
  const auto greedy = join({}, "192.0.2.2", wish_for_4k).connection;
  const auto another = join({}, "192.0.2.2", wish_for_4k).connection;
  const auto honest = join().connection;
  ASSERT_TRUE(greedy->welcome && another->welcome && honest->welcome);
  EXPECT_LT(greedy->welcome->config().width_px(), 3840u);
  EXPECT_LT(another->welcome->config().width_px(), greedy->welcome->config().width_px());
  EXPECT_EQ(honest->welcome->config().width_px(), 160u);
}

TEST_F(MeasuredAdmission, WhoTakesMoreThanAnEqualShareGivesPixelsUpWhileOthersNeedThem) {
  start(300.0f);
  const auto greedy = join({}, "192.0.2.2", wish_for_4k).connection;
  EXPECT_EQ(greedy->welcome->config().width_px(), 3840u) << "nobody else is there";
  measure();
  EXPECT_TRUE(join().connection->welcome);
  move_until([&] { return greedy->config && greedy->config->width_px() < 3840u; });
  leave(1);
  move_until([&] { return greedy->config->width_px() == 3840u; });
}

void wish_for_a_frame_a_second(v1::Hello& hello) { hello.mutable_settings()->set_max_fps(1); }

TEST_F(MeasuredAdmission, WhoFindsNoRoomIsNotInTheWayOfWhoDoes) {
  start(90.0f);
  join();
  measure();
  join();
  ASSERT_TRUE(join().connection->waits);
  EXPECT_TRUE(join({}, "192.0.2.2", wish_for_a_frame_a_second).connection->welcome);
}

TEST_F(MeasuredAdmission, WhoHasWaitedForLongIsNotOvertakenAnyMore) {
  options.policy.overtaken_at_most = 0ms;
  start(90.0f);
  join();
  measure();
  join();
  const auto first = join().connection;
  const auto second = join({}, "192.0.2.2", wish_for_a_frame_a_second).connection;
  ASSERT_TRUE(first->waits && second->waits);
  leave(1);
  run_until([&] { return first->welcome && second->welcome; });
}

TEST_F(RegistryTest, NobodyWaitsWithoutEnd) {
  options.max_sessions = 1;
  options.policy.longest_wait = 100ms;
  start();
  join();
  const auto connection = join().connection;
  ASSERT_TRUE(connection->waits);
  run_until([&] { return connection->error.has_value(); });
  EXPECT_EQ(connection->error->code(), v1::Error::SERVER_FULL);
  EXPECT_THAT(connection->error->message(), testing::HasSubstr("no place came free"));
}

TEST_F(RegistryTest, WhoWaitsForMeasurementsIsToldSo) {
  options.min_fps = 10;
  options.cpus = 1;
  options.max_queue = 1;
  start();
  join();
  EXPECT_TRUE(join().connection->waits);
  EXPECT_EQ(clients.back().connection->estimate_s, 3u);
  const Visitor& third = join();
  ASSERT_TRUE(third.connection->error);
  EXPECT_THAT(third.connection->error->message(),
              testing::HasSubstr("1 wait for it: try again in 3 s"));
}

TEST_F(RegistryTest, ATokenIsCheckedAsOftenHoweverManyScenesThereAre) {
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

TEST_F(RegistryTest, AddressesOfOneNetworkOfIpv6ShareTheirLimit) {
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
  run_until([&] { return registry->connections() == 1; });
  EXPECT_TRUE(admits("2001:db8:1:2::3")) << "who leaves is counted no more";
}

TEST_F(RegistryTest, RefusalsAreThoseOfStrangersInTheLog) {
  const auto before = spdlog::default_logger();
  testing::internal::CaptureStderr();
  set_up_log("human", "info");
  start();
  for (int i = 0; i < 2000; ++i) {
    const auto stranger = registry->accept(std::make_shared<OpenConnection>("192.0.2.1"));
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

TEST_F(RegistryTest, SessionsHaveIdsThatNoOtherServerGivesAway) {
  start();
  std::set<std::string> ids;
  for (int i = 0; i < 4; ++i) ids.insert(join().connection->welcome->session_id());
  EXPECT_EQ(ids.size(), 4u);
  EXPECT_THAT(ids, testing::Each(testing::MatchesRegex("[0-9a-f]{32}")));
}

TEST_F(RegistryTest, TakesMessagesAtTheirRate) {
  start();
  const TimePoint start = Clock::now();
  Visitor& visitor = clients.emplace_back(Visitor{
      std::make_shared<OpenConnection>(), registry->accept(std::make_shared<OpenConnection>())});
  for (int i = 0; i < 1200; ++i) move(visitor);
  EXPECT_EQ(metrics.poses_received.Value(), 1200.0);
  std::this_thread::sleep_for(250ms);
  for (int i = 0; i < 2000; ++i) move(visitor);
  const std::chrono::duration<double> elapsed = Clock::now() - start;
  EXPECT_GE(metrics.poses_received.Value(), 1200 + 150);
  EXPECT_LE(metrics.poses_received.Value(), 1201 + 600 * elapsed.count());
}

TEST_F(RegistryTest, RefusesAFloodOnce) {
  start();
  auto connection = std::make_shared<OpenConnection>();
  Visitor& flooding = clients.emplace_back(Visitor{connection, registry->accept(connection)});
  flooding.listener->on_flood();
  move(flooding);
  flooding.listener->on_flood();
  run_until([&] { return connection->closed.has_value(); });
  EXPECT_EQ(connection->closed, CloseCode::policy_violation);
  EXPECT_EQ(connection->error->code(), v1::Error::RATE_LIMITED);
  EXPECT_EQ(metrics.sessions_refused.Value(), 1.0);
  EXPECT_EQ(metrics.poses_received.Value(), 0.0);
}

TEST_F(RegistryTest, RefusesConnectionsBeyondAllPlaces) {
  options.max_sessions = 2;
  options.max_spectators = 3;
  options.max_queue = 4;
  options.max_sessions_per_address = 1000;
  start();
  std::vector<std::shared_ptr<OpenConnection>> connections;
  for (int i = 0; i < 2 * (1 + 3) + 4 + 64 + 1; ++i) {
    connections.push_back(std::make_shared<OpenConnection>());
    clients.emplace_back(Visitor{connections.back(), registry->accept(connections.back())});
  }
  run_until([&] { return connections.back()->closed.has_value(); });
  EXPECT_EQ(connections.back()->error->code(), v1::Error::SERVER_FULL);
  EXPECT_FALSE(connections[connections.size() - 2]->closed);
}

}  // namespace
}  // namespace catgs::test

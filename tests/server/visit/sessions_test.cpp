// Who gets which device and which encoder, and who is refused.

#include <spdlog/spdlog.h>

#include "server/base/log.h"
#include "tests/server/visit/sessions_fixture.h"
#include "tests/support/test.h"

namespace catgs::test {
namespace {

TEST_F(SessionsTest, NewSessionsGoWhereLessWorkIsMeasured) {
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

TEST_F(SessionsTest, X264ServesWhenNvencDoesNotOpen) {
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

TEST_F(SessionsTest, ATokenIsCheckedAsOftenHoweverManyScenesThereAre) {
  int checks = 0;
  authorize = [&](const auto&) {
    ++checks;
    return Permit{[](auto scene_id, Use) {
      return scene_id == "secret" ? Refusal("not for you") : std::nullopt;
    }};
  };
  start();
  join();
  const int for_one_scene = std::exchange(checks, 0);
  scenes.ids.assign(1000, "another");
  scenes.ids.emplace_back("secret");
  EXPECT_EQ(join().connection->welcome->scene_ids_size(), 1000);
  EXPECT_EQ(checks, for_one_scene);
}

TEST_F(SessionsTest, AddressesOfOneNetworkOfIpv6ShareTheirLimit) {
  options.max_sessions_per_address = 2;
  start();
  const auto admits = [&](const char* from) {
    return join({}, from).connection->welcome.has_value();
  };
  EXPECT_TRUE(admits("2001:db8:1:2::1"));
  EXPECT_TRUE(admits("2001:db8:1:2:ffff::2"));
  ASSERT_FALSE(admits("2001:db8:1:2::3"));
  EXPECT_THAT(clients.back().connection->error->message(),
              HasSubstr("from 2001:db8:1:2::/64 already"));
  EXPECT_TRUE(admits("2001:db8:1:3::1")) << "a neighbour's";
  for (const std::size_t index : {3u, 2u, 0u}) leave(index);
  run_until([&] { return sessions->connections() == 1; });
  EXPECT_TRUE(admits("2001:db8:1:2::3")) << "who leaves is counted no more";
}

TEST_F(SessionsTest, RefusalsAreThoseOfStrangersInTheLog) {
  const auto before = spdlog::default_logger();
  testing::internal::CaptureStderr();
  set_up_log("human", "info");
  start();
  for (int i = 0; i < 2000; ++i) {
    const auto stranger = sessions->accept(std::make_shared<OpenConnection>("192.0.2.1"));
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

TEST_F(SessionsTest, SessionsHaveIdsThatNoOtherServerGivesAway) {
  start();
  std::set<std::string> ids;
  for (int i = 0; i < 4; ++i) ids.insert(join().connection->welcome->session_id());
  EXPECT_EQ(ids.size(), 4u);
  EXPECT_THAT(ids, Each(MatchesRegex("[0-9a-f]{32}")));
}

TEST_F(SessionsTest, APictureAtRestIsDrawnAgainWhenPagesCome) {
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
  run_until([&] {
    acknowledge(visitor);  // a late frame would hold the next one back
    return drawn() > before;
  });
}

TEST_F(SessionsTest, RefusesConnectionsBeyondAllSlots) {
  options.max_sessions = 2;
  options.max_spectators = 3;
  options.max_queue = 4;
  options.max_sessions_per_address = 1000;
  start();
  std::vector<std::shared_ptr<OpenConnection>> connections;
  for (int i = 0; i < 2 * (1 + 3) + 4 + 64 + 1; ++i) {
    connections.push_back(std::make_shared<OpenConnection>());
    clients.emplace_back(Visitor{connections.back(), sessions->accept(connections.back())});
  }
  run_until([&] { return connections.back()->closed.has_value(); });
  EXPECT_EQ(connections.back()->error->code(), v1::Error::SERVER_FULL);
  EXPECT_FALSE(connections[connections.size() - 2]->closed);
}

/// A leader and one who follows.
class SharedTourTest : public SessionsTest {
 protected:
  void begin(bool pings, bool tells_places) {
    start();
    leader = &join();
    present(pings, tells_places);
    follower = &join();
    follow(*follower);
  }
  void follow(Visitor& visitor) {
    v1::ClientMessage message;
    message.mutable_follow()->set_watch(leader->connection->welcome->watch_token());
    say(visitor, message);
    run_until([&] { return visitor.connection->lead.has_value(); });
  }
  void present(bool pings, bool tells_places) {
    v1::ClientMessage message;
    message.mutable_present()->set_on(true);
    message.mutable_present()->set_name("Ada");
    message.mutable_present()->set_pings(pings);
    message.mutable_present()->set_tells_places(tells_places);
    say(*leader, message);
    run_until(
        [&] { return leader->connection->lead && leader->connection->lead->may_ping() == pings; });
  }
  /// The leader presents there, as its page does.
  void lead_to_the_attic() {
    v1::ClientMessage message;
    message.mutable_select_scene()->set_scene_id("attic");
    say(*leader, message);
    run_until([&] { return leader->connection->welcome->scene().scene_id() == "attic"; });
    present(true, false);
  }
  /// How many pings both of them hear of `count` that this visitor sends.
  std::size_t heard_of(Visitor& from, int count) {
    const std::size_t before = leader->connection->pinged.size();
    v1::ClientMessage message;
    message.mutable_ping()->mutable_place()->set_x(7.0f);
    for (int i = 0; i < count; ++i) say(from, message);
    run_for(100ms);
    EXPECT_EQ(leader->connection->pinged.size(), follower->connection->pinged.size());
    return leader->connection->pinged.size() - before;
  }

  Visitor* leader = nullptr;
  Visitor* follower = nullptr;
};

TEST_F(SharedTourTest, AllSeeWhereTheLeaderPointsTwiceASecondAtMost) {
  begin(false, false);
  EXPECT_EQ(heard_of(*leader, 20), 2u);
  const v1::Pinged& last = follower->connection->pinged.back();
  EXPECT_EQ(last.place().x(), 7.0f);
  EXPECT_TRUE(last.by_leader());
}

TEST_F(SharedTourTest, FollowersPointWhereTheLeaderLetsThem) {
  begin(false, false);
  EXPECT_FALSE(follower->connection->lead->may_ping());
  EXPECT_EQ(heard_of(*follower, 1), 0u);
  present(true, false);
  run_until([&] { return follower->connection->lead->may_ping(); });
  EXPECT_EQ(heard_of(*follower, 1), 1u);
  EXPECT_FALSE(leader->connection->pinged.back().by_leader());
  Visitor& stranger = join();
  EXPECT_EQ(heard_of(stranger, 1), 0u) << "who follows nobody points at nothing";
}

TEST_F(SharedTourTest, ParticipantsHearWhichStopTheHostSees) {
  begin(false, false);
  const auto show = [&](std::uint32_t stop, bool arrived) {
    v1::ClientMessage message;
    message.mutable_show()->set_tour(1);
    message.mutable_show()->set_stop(stop);
    message.mutable_show()->set_arrived(arrived);
    say(*leader, message);
  };
  EXPECT_FALSE(follower->connection->lead->has_shown());
  show(3, false);
  run_until([&] { return follower->connection->lead->shown().stop() == 3; });
  EXPECT_FALSE(follower->connection->lead->shown().arrived());
  show(3, true);
  run_until([&] { return follower->connection->lead->shown().arrived(); });
  Visitor& late = join();
  follow(late);
  EXPECT_EQ(late.connection->lead->shown().stop(), 3u) << "at once";
  EXPECT_EQ(late.connection->lead->shown().tour(), 1u);
  lead_to_the_attic();
  follow(late);
  EXPECT_FALSE(late.connection->lead->has_shown()) << "another scene has other stops";
}

TEST_F(SharedTourTest, SharedTourBeginsAFewTimesASecondAtMost) {
  begin(false, false);
  v1::ClientMessage off, on, follows;
  off.mutable_present()->set_on(false);
  on.mutable_present()->set_on(true);
  follows.mutable_follow()->set_watch(leader->connection->welcome->watch_token());
  const auto flood = [&](Visitor& visitor, const v1::ClientMessage& again) {
    for (int i = 0; i < 20; ++i) {
      say(visitor, off);
      say(visitor, again);
    }
    run_until([&] { return visitor.connection->error.has_value(); });
    EXPECT_EQ(visitor.connection->error->code(), v1::Error::RATE_LIMITED);
    EXPECT_FALSE(visitor.connection->error->fatal());
    EXPECT_FALSE(visitor.connection->closed);
    run_for(100ms);
    EXPECT_LT(visitor.connection->errors, 10) << "a flood is not answered message by message";
  };
  flood(*follower, follows);
  EXPECT_EQ(follower->connection->lead->state(), v1::Lead::ENDED);
  flood(*leader, on);
  Visitor& later = join();
  follow(later);
  EXPECT_EQ(later.connection->lead->state(), v1::Lead::ENDED) << "nobody leads any more";
}

TEST_F(SharedTourTest, NobodyIsToldWhereOthersAreUnlessTheLeaderWantsIt) {
  begin(false, false);
  move(*leader);
  move(*follower);
  run_for(700ms);
  EXPECT_TRUE(leader->connection->companies.empty());
  EXPECT_TRUE(follower->connection->companies.empty());
}

TEST_F(SharedTourTest, AllHearWhereTheyAreWhileTheLeaderWantsIt) {
  begin(false, true);
  const auto& told = follower->connection->companies;
  move(*leader);
  move(*follower);
  move(*follower);
  run_until([&] { return !told.empty() && told.back().places_size() == 2; });
  EXPECT_EQ(told.back().places(0).x(), 1.0f) << "the leader first";
  EXPECT_EQ(told.back().places(1).x(), 2.0f);
  const std::size_t before = told.size();
  run_for(1200ms);
  EXPECT_EQ(told.size(), before) << "nobody moves";
  present(false, false);
  run_until([&] { return told.back().places_size() == 0; });
  EXPECT_EQ(leader->connection->companies.size(), told.size());
}

// The camera of a plan is far above its visitor.
TEST_F(SharedTourTest, NobodyIsToldWhereOrthographicCamerasAre) {
  begin(false, true);
  const auto& told = follower->connection->companies;
  move(*leader);
  move(*follower);
  run_until([&] { return !told.empty() && told.back().places_size() == 2; });
  move(*follower, 12.0f);
  run_until([&] { return told.back().places_size() == 1; });
}

TEST_F(SharedTourTest, ANewcomerHearsAtOnceWhereTheOthersAre) {
  begin(false, true);
  move(*leader);
  run_until([&] { return !follower->connection->companies.empty(); });
  Visitor& later = join();
  follow(later);
  Visitor& spectator = join({}, "192.0.2.1", [&](v1::Hello& hello) {
    hello.set_watch(leader->connection->welcome->watch_token());
  });
  for (const Visitor* newcomer : {&later, &spectator}) {
    ASSERT_EQ(newcomer->connection->companies.size(), 1u) << "though nobody has moved";
    EXPECT_EQ(newcomer->connection->companies[0].places(0).x(), 1.0f);
  }
}

TEST_F(SharedTourTest, AFollowerThatEntersAnotherSceneLeavesIt) {
  begin(true, true);
  move(*leader);
  move(*follower);
  const auto& told = leader->connection->companies;
  run_until([&] { return !told.empty() && told.back().places_size() == 2; });
  EXPECT_EQ(leader->connection->lead->company(), 1u);

  v1::ClientMessage message;
  message.mutable_select_scene()->set_scene_id("attic");
  say(*follower, message);
  run_until([&] { return follower->connection->welcome->scene().scene_id() == "attic"; });
  EXPECT_EQ(follower->connection->lead->state(), v1::Lead::ENDED);
  EXPECT_FALSE(follower->connection->lead->elsewhere()) << "the leader is where it was";
  run_until([&] { return told.back().places_size() == 1; });
  EXPECT_EQ(leader->connection->lead->company(), 0u);
  EXPECT_EQ(heard_of(*follower, 1), 0u);

  // Whoever comes back is where its camera has been since.
  message.mutable_select_scene()->set_scene_id("scene");
  say(*follower, message);
  run_until([&] { return follower->connection->welcome->scene().scene_id() != "attic"; });
  follow(*follower);
  run_for(700ms);
  EXPECT_EQ(told.back().places_size(), 1);
}

TEST_F(SharedTourTest, HearsThatTheLeaderIsInAnotherSceneAndFindsItThere) {
  begin(false, false);
  lead_to_the_attic();
  EXPECT_EQ(follower->connection->lead->state(), v1::Lead::ENDED);
  EXPECT_TRUE(follower->connection->lead->elsewhere());
  // Whoever asks from the old scene hears the same, and a new greeting leads to the leader's.
  follower->connection->lead.reset();
  follow(*follower);
  EXPECT_TRUE(follower->connection->lead->elsewhere());
  EXPECT_EQ(follower->connection->lead->name(), "Ada");
  EXPECT_FALSE(follower->connection->error);
  Visitor& again =
      join(follower->connection->welcome->resume_token(), "192.0.2.1", [&](v1::Hello& hello) {
        hello.set_watch(leader->connection->welcome->watch_token());
        hello.set_follow(true);
      });
  EXPECT_EQ(again.connection->welcome->scene().scene_id(), "attic");
  EXPECT_EQ(again.connection->welcome->session_id(), follower->connection->welcome->session_id());
  follow(again);
  EXPECT_EQ(again.connection->lead->state(), v1::Lead::LEADS);
}

TEST_F(SharedTourTest, AFollowerWithoutAccessToTheLeadersSceneOnlyWatchesIt) {
  authorize = [](const std::string& token) {
    return Permit{[narrow = token == "narrow"](std::string_view scene_id, Use) -> Refusal {
      return narrow && scene_id == "attic" ? Refusal("not yours") : std::nullopt;
    }};
  };
  begin(false, false);
  const auto join_by_narrow_link = [&](const std::string& resume_token, const auto& request) {
    return join(resume_token, "192.0.2.1",
                [&](v1::Hello& hello) {
                  hello.set_token("narrow");
                  request(hello);
                })
        .connection;
  };
  const auto before = join_by_narrow_link({}, [](v1::Hello&) {});
  ASSERT_FALSE(before->welcome->watching());
  lead_to_the_attic();
  const auto along = join_by_narrow_link(before->welcome->resume_token(), [&](v1::Hello& hello) {
    hello.set_watch(leader->connection->welcome->watch_token());
    hello.set_follow(true);
  });
  ASSERT_TRUE(along->welcome);
  EXPECT_TRUE(along->welcome->watching());
  EXPECT_EQ(along->welcome->scene().scene_id(), "attic");
  EXPECT_FALSE(along->welcome->may_leave());
  const auto alone = join_by_narrow_link(before->welcome->resume_token(),
                                         [](v1::Hello& hello) { hello.set_scene_id("attic"); });
  ASSERT_TRUE(alone->error);
  EXPECT_EQ(alone->error->code(), v1::Error::UNAUTHORIZED);
}

TEST_F(SessionsTest, VisitorsPrepareFewScenesAndNoneThatTheyMayNotEnter) {
  authorize = [](const auto&) {
    return Permit{[](std::string_view scene_id, Use) -> Refusal {
      return scene_id == "vault" ? Refusal("not yours") : std::nullopt;
    }};
  };
  start();
  Visitor& visitor = join();
  for (const char* id : {"vault", "hall", "attic", "barn", "garden"}) {
    v1::ClientMessage message;
    message.mutable_prepare()->set_scene_id(id);
    say(visitor, message);
  }
  run_for(100ms);
  EXPECT_THAT(scenes.prepared, ElementsAre("hall", "attic"));
}

TEST_F(SessionsTest, StopsThatNoTourHasAreNotCounted) {
  scenes.give_tours(R"({"tours":[{"stops":[{},{}]},{"stops":[]},{"stops":[{}]}]})");
  start();
  Visitor& visitor = join();
  for (std::uint32_t tour = 0; tour < 32; ++tour)
    for (std::uint32_t stop = 0; stop < 8; ++stop) {
      v1::ClientMessage message;
      message.mutable_reached()->set_tour(tour);
      message.mutable_reached()->set_stop(stop);
      say(visitor, message);
    }
  run_for(100ms);
  DayCounts all;
  for (const std::string& date : counts.dates()) add(counts.day(date), all);
  EXPECT_EQ(all[""].stops, (std::map<StopId, std::uint64_t>{{{0, 0}, 1}, {{0, 1}, 1}, {{1, 0}, 1}}))
      << "pages leave out tours without stops";
}

}  // namespace
}  // namespace catgs::test

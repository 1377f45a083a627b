// What fails under the sessions, by interfaces that fail: Renderer, View, Encoder, the pool, the
// clock. Each fault is told, counted, and nobody else's.

#include "tests/server/visit/sessions_fixture.h"
#include "tests/support/test.h"

namespace catgs::test {
namespace {

class Faults : public SessionsTest {
 protected:
  Faults() {
    on_devices_lost = [this](const std::string& why) {
      ++given_up;
      why_given_up = why;
    };
  }
  /// A server with so many visitors, who see frames.
  void begin(int visitors) {
    start();
    for (int i = 0; i < visitors; ++i) join();
    move_on(3);
  }
  void only_x264() { encoders = {{EncoderKind::x264, Codec::h264, "libx264"}}; }
  [[nodiscard]] int failed_frames() const {
    return static_cast<int>(metrics.frames_failed.Value());
  }
  [[nodiscard]] int failed_streams() const {
    return static_cast<int>(metrics.streams_failed.Value());
  }
  [[nodiscard]] bool nobody_is_told() const {
    return std::ranges::none_of(
        clients, [](const auto& c) { return c.connection->error || c.connection->closed; });
  }
  [[nodiscard]] int closed() const {
    return static_cast<int>(std::ranges::count_if(
        clients, [](const auto& c) { return c.connection->closed.has_value(); }));
  }

  // Of frames that do not end. They outlive the test, as frames may start until it is torn down.
  std::promise<void> release;
  const std::shared_future<void> released = release.get_future().share();
  std::atomic<bool> hold{false};
  std::atomic<int> held{0};
  int given_up = 0;
  std::string why_given_up;
};

TEST_F(Faults, MessagesWaitForASessionThreadThatIsBusyUpToABound) {
  only_x264();
  start();
  const auto say_often = [this](int times, int padding) {
    Visitor& visitor = join();
    v1::ClientMessage message;
    message.mutable_request_idr();
    std::string bytes = message.SerializeAsString();
    for (int i = 0; i < padding; ++i) bytes += "\xa0\x06\x01";  // field 100, that nobody knows
    for (int i = 0; i < times; ++i)                             // io does not run meanwhile
      visitor.listener->on_message(std::as_bytes(std::span(bytes)), {});
    io.run_for(5ms);
    move_until([&] { return visitor.connection->closed || !visitor.connection->frames.empty(); });
    return visitor.connection->error ? visitor.connection->error->code()
                                     : v1::Error::CODE_UNSPECIFIED;
  };
  EXPECT_EQ(say_often(1024, 0), v1::Error::CODE_UNSPECIFIED);
  EXPECT_EQ(say_often(1025, 0), v1::Error::RATE_LIMITED);
  EXPECT_EQ(say_often(16, 21'800), v1::Error::CODE_UNSPECIFIED);
  EXPECT_EQ(say_often(17, 21'800), v1::Error::RATE_LIMITED);
}

TEST_F(Faults, AnEncoderThatFailsIsOpenedAnew) {
  only_x264();
  begin(2);
  const int opened = encoding.opened;
  const int idrs = clients[0].connection->idrs + clients[1].connection->idrs;
  encoding.frames_that_fail = 1;
  move_until([&] { return failed_frames() == 1; });
  move_on(3);
  EXPECT_EQ(encoding.opened, opened + 1);
  EXPECT_EQ(clients[0].connection->idrs + clients[1].connection->idrs, idrs + 1);
  EXPECT_TRUE(nobody_is_told());
}

TEST_F(Faults, AnNvencThatFailsMakesWayForX264) {
  begin(1);
  const Visitor& visitor = clients[0];
  encoding.frames_that_fail = 1;
  move_until([&] { return failed_frames() == 1; });
  move_on(3);
  ASSERT_TRUE(visitor.connection->config);
  EXPECT_EQ(visitor.connection->config->encoder(), "libx264");
  EXPECT_EQ(metrics.encoders_refused.Value(), 0.0) << "it was open";
  EXPECT_EQ(encoding.nvenc_open, 0);
  EXPECT_TRUE(nobody_is_told());
  EXPECT_EQ(encoder_of(join()), "h264_nvenc");
}

TEST_F(Faults, EncodersThatAlwaysFailEndTheirSessionsWithTheReason) {
  only_x264();
  start();
  const Visitor& visitor = join();
  encoding.frames_that_fail = 1000;
  move_until([&] { return visitor.connection->closed.has_value(); });
  EXPECT_EQ(failed_frames(), 3);
  EXPECT_EQ(visitor.connection->error->code(), v1::Error::RENDER_FAILED);
  EXPECT_THAT(visitor.connection->error->message(), HasSubstr("libx264: the driver was reset"));
  leave(0);
  encoding.frames_that_fail = 0;
  join();
  move_on(3);
}

TEST_F(Faults, AFrameWithoutMemoryIsDrawnAgain) {
  begin(1);
  renderer->frames_without_memory = 2;
  move_until([&] { return failed_frames() == 2; });
  move_on(3);
  EXPECT_TRUE(nobody_is_told());
  EXPECT_EQ(renderer->views_made, 1) << "it kept its View";
}

TEST_F(Faults, AVisitorWithoutDeviceMemoryMayComeBack) {
  begin(1);
  renderer->full[0] = renderer->full[1] = true;
  for (int i = 0; i < 3; ++i) {
    const auto refused = join().connection;
    ASSERT_TRUE(refused->error);
    EXPECT_EQ(refused->error->code(), v1::Error::INTERNAL);
    EXPECT_THAT(refused->error->message(), HasSubstr("lists: out of memory"));
    EXPECT_EQ(refused->closed, CloseCode::try_again_later);
    leave(1);
  }
  EXPECT_EQ(failed_streams(), 3);
  move_on(3);
  EXPECT_EQ(given_up, 0) << "the device works";
  renderer->full[0] = renderer->full[1] = false;
  EXPECT_TRUE(join().connection->welcome);
  move_on(3);
}

TEST_F(Faults, SessionsOfALostDeviceGoOnOnAnother) {
  begin(2);
  ASSERT_EQ(devices->views(), (std::map<int, int>{{0, 1}, {1, 1}}));
  renderer->lost[0] = true;
  move_until([&] { return failed_frames() == 1; });
  move_on(3);
  EXPECT_EQ(devices->views(), (std::map<int, int>{{0, 0}, {1, 2}}));
  EXPECT_TRUE(nobody_is_told());
  EXPECT_EQ(given_up, 0);
}

TEST_F(Faults, TheServerGivesUpWhenNoDeviceIsLeft) {
  begin(2);
  renderer->lost[0] = renderer->lost[1] = true;
  move_until([&] { return closed() == 2; });
  for (const auto& client : clients) {
    EXPECT_EQ(client.connection->error->code(), v1::Error::INTERNAL) << "pages come again";
    EXPECT_EQ(client.connection->closed, CloseCode::try_again_later);
  }
  EXPECT_THAT(why_given_up, HasSubstr("illegal memory access"));
  EXPECT_EQ(failed_frames(), 2);
  EXPECT_EQ(failed_streams(), 2);
}

TEST_F(Faults, AFullDeviceBesideALostOneServesThoseItHas) {
  begin(3);
  ASSERT_EQ(devices->views(), (std::map<int, int>{{0, 2}, {1, 1}}));
  renderer->full[1] = true;
  renderer->lost[0] = true;
  for (int i = 0; i < 3; ++i) {  // the full one has fewer Views: the lost one is asked last
    const auto refused = join().connection;
    EXPECT_EQ(refused->closed, CloseCode::try_again_later);
    EXPECT_THAT(refused->error->message(), HasSubstr("out of memory"));
    leave(3);
  }
  move_until([&] { return closed() == 2; });
  move_on(3);
  EXPECT_EQ(devices->views(), (std::map<int, int>{{0, 0}, {1, 1}}));
  EXPECT_EQ(given_up, 0) << "a device works";
  renderer->full[1] = false;
  EXPECT_TRUE(join().connection->welcome);
  move_on(3);
}

TEST_F(Faults, OneRefusalWithoutAFailedFrameIsNoLostDevice) {
  start();
  for (int i = 0; i < 3; ++i) {  // a driver that is being reset, now and then
    renderer->lost[0] = renderer->lost[1] = true;
    EXPECT_TRUE(join().connection->closed);
    leave(0);
    renderer->lost[0] = renderer->lost[1] = false;
    join();
    move_on(1);
    leave(0);
    run_until([&] {  // its last frame has ended well
      const auto views = devices->views();
      return std::ranges::all_of(views, [](const auto& view) { return view.second == 0; });
    });
  }
  EXPECT_EQ(given_up, 0);
}

TEST_F(Faults, ASaturatedPoolSilencesNobody) {
  renderer->before_frame = [&](int) {
    if (!hold) return;
    ++held;
    released.wait();
  };
  begin(2);
  hold = true;
  move_until([&] { return held == pool_threads; });  // each thread has a frame that does not end
  const auto frames = metrics.frames_rendered.Value();
  for (auto& client : clients) client.connection->heartbeats = 0;
  move_until([&] {
    return std::ranges::all_of(clients, [](const auto& c) { return c.connection->heartbeats > 0; });
  });
  EXPECT_EQ(metrics.frames_rendered.Value(), frames);
  EXPECT_EQ(metrics.frames_running.Value(), pool_threads);
  hold = false;
  release.set_value();
  move_on(3);
  EXPECT_TRUE(nobody_is_told());
}

TEST_F(Faults, TheWallClockMayJump) {
  constexpr std::int64_t day_s = 24 * 3600;
  std::int64_t wall_s = 1'700'000'000;
  options.wall_clock_s = [&] { return wall_s; };
  start();
  const v1::Welcome welcome = *join().connection->welcome;
  move_on(3);
  wall_s -= 365 * day_s;
  move_on(3);
  leave(0, false);
  EXPECT_EQ(join(welcome.resume_token()).connection->welcome->session_id(), welcome.session_id());
  move_on(3);
  wall_s += 3 * 365 * day_s;
  move_on(3);
  EXPECT_TRUE(nobody_is_told());
  leave(0, false);
  const auto anew = join(welcome.resume_token()).connection;
  ASSERT_TRUE(anew->welcome) << "the token is too old: a new session, no error";
  EXPECT_NE(anew->welcome->session_id(), welcome.session_id());
  move_on(3);
}

}  // namespace
}  // namespace catgs::test

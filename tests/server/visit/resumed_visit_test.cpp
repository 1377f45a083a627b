// A session that waits for its slot, loses its client, gets it back: with a fake clock.

#include "tests/server/visit/visit_fixture.h"
#include "tests/support/test.h"

namespace catgs {
namespace {

class SessionLife : public test::VisitTest {
 protected:
  Admission admission() const { return std::get<Admission>(host.admission); }
  Hello resuming() const {
    Hello hello;
    hello.version = 1;
    hello.viewport_px = {640, 361};
    hello.decoders = {Codec::h264};
    hello.resume_token = "again";
    return hello;
  }
  void resume() { session.on_resumed(resuming(), admission(), now); }
};

TEST_F(SessionLife, WaitsForAPlaceAndSpeaksMeanwhile) {
  const AdmissionAnswer granted = std::exchange(host.admission, QueuePosition{3, 40s});
  Hello hello = resuming();
  session.on_message(hello, now);
  EXPECT_EQ(session.life().state(), VisitState::queued);
  ASSERT_EQ(host.count<QueuePosition>(), 1);
  EXPECT_EQ(std::get<QueuePosition>(host.said.back()).position, 3);

  now += policy.hello_timeout + policy.idle_timeout;
  session.on_tick(now);
  EXPECT_FALSE(host.closed) << "who waits is neither late nor idle";
  pose(1, 0.0f);  // means nothing yet, and does no harm
  Settings smaller;
  smaller.size_px = {320, 180};
  session.on_message(smaller, now);
  session.say(QueuePosition{1, 10s}, now);
  EXPECT_EQ(std::get<QueuePosition>(host.said.back()).position, 1);

  host.admission = granted;
  session.ask_again(now);
  EXPECT_EQ(session.life().state(), VisitState::opening);
  ASSERT_EQ(host.opened.size(), 1u);
  EXPECT_EQ(host.opened[0].encoding.size_px, glm::ivec2(320, 180)) << "requests of those who wait";
  open_stream();
  EXPECT_EQ(host.count<Welcome>(), 1);
  session.on_tick(now);
  EXPECT_FALSE(host.closed) << "the time in the queue was not idle";
}

TEST_F(SessionLife, BeginsAtThePoseOfAResumingHello) {
  Hello hello = resuming();
  hello.resume_pose = PoseSample{7, 7000, {}, 1.0f};
  session.on_message(hello, now);
  open_stream();
  ASSERT_TRUE(frame_is_due()) << "no pose has to come first";
  EXPECT_EQ(run_frame().ticket.pose_id, 7u);
}

TEST_F(SessionLife, ATourGoesOnOnAnotherServer) {
  Hello hello = resuming();
  for (int i = 0; i < 20; ++i) {  // two seconds at one unit a second
    PoseSample sample{0, i * 100'000, {}, 1.0f};
    sample.world_from_camera.position.x = 0.1f * static_cast<float>(i);
    hello.resume_path.samples.push_back(sample);
  }
  hello.resume_pose = hello.resume_path.samples[5];
  hello.resume_pose->world_from_camera.position.x += 0.001f;
  session.on_message(hello, now);
  open_stream();
  ASSERT_TRUE(frame_is_due());
  const FrameOrder order = run_frame();
  EXPECT_TRUE(order.force_idr);
  // The camera is on the tour again before a second pose has come.
  EXPECT_FLOAT_EQ(order.request.camera.world_from_camera.position.x, 0.5f);
}

TEST_F(SessionLife, RendersNothingWhileItsClientIsLost) {
  greet();
  pose(1, 0.0f);
  ack(run_frame().ticket.frame_id);
  session.on_message(RequestIdr{}, now);
  const auto said = host.said.size();
  session.on_lost(now);
  for (auto waited = 0ms; waited < 30s; waited += 250ms) {
    session.on_tick(now + waited);
    EXPECT_FALSE(session.next_frame());
    EXPECT_TRUE(session.life().resumable());
  }
  EXPECT_EQ(host.said.size(), said);
  session.on_tick(now + 30s - 1ms);
  EXPECT_TRUE(session.life().resumable());
  session.on_tick(now + 30s);
  EXPECT_EQ(session.life().state(), VisitState::closed);
}

TEST_F(SessionLife, GivesALostClientItsSessionBackWithOneIdr) {
  greet();
  pose(1, 0.0f);
  ack(run_frame().ticket.frame_id);
  pose(2, 1.0f);
  now += 1s;
  run_frame();  // never acknowledged
  session.on_lost(now);
  now += 20s;
  resume();
  EXPECT_EQ(host.count<Welcome>(), 2);
  EXPECT_EQ(host.opened.size(), 1u) << "the stream with its caches is the same";
  EXPECT_EQ(std::get<Welcome>(host.said.back()).session_id, "test");
  ASSERT_TRUE(frame_is_due()) << "frames in flight went with the connection, the pose did not";
  const FrameOrder order = run_frame();
  EXPECT_TRUE(order.force_idr);
  EXPECT_EQ(order.ticket.pose_id, 2u);
  ack(order.ticket.frame_id);
  pose(3, 2.0f);
  now += 1s;
  ASSERT_TRUE(frame_is_due());
  EXPECT_FALSE(run_frame().force_idr);
  session.on_tick(now);
  EXPECT_FALSE(host.closed);
}

TEST_F(SessionLife, AFrameOfTheLostConnectionNeverReachesTheNewOne) {
  greet();
  pose(1, 0.0f);
  const FrameOrder old = session.start_frame(now);
  session.on_lost(now);
  resume();
  finish(old);
  EXPECT_TRUE(host.frames.empty());
  EXPECT_EQ(session.flow().credit().in_flight(), 0);
  ASSERT_TRUE(frame_is_due());
  EXPECT_TRUE(run_frame().force_idr);
  EXPECT_EQ(host.frames.size(), 1u);
}

TEST_F(SessionLife, TakesTheRequestsOfTheResumingHello) {
  greet();
  pose(5, 0.0f);
  ack(run_frame().ticket.frame_id);
  session.on_lost(now);
  Hello hello = resuming();
  hello.viewport_px = {320, 180};
  hello.resume_pose = PoseSample{2, 2000, {}, 1.0f};  // of a page that counts anew
  session.on_resumed(hello, admission(), now);
  EXPECT_EQ(host.opened.size(), 1u) << "the stream with its caches is the same";
  ASSERT_EQ(host.count<Welcome>(), 2);
  EXPECT_EQ(std::get<Welcome>(host.said.back()).config.size_px, glm::ivec2(320, 180));
  now += 1s;
  ASSERT_TRUE(frame_is_due());
  const FrameOrder order = run_frame();
  EXPECT_EQ(order.ticket.pose_id, 2u);
  EXPECT_EQ(order.ticket.size_px, glm::ivec2(320, 180));
  EXPECT_TRUE(order.force_idr);
}

TEST_F(SessionLife, AnotherCodecOrSceneReopensTheStream) {
  greet();
  session.on_lost(now);
  Admission jpeg = admission();
  jpeg.encoder = {EncoderKind::jpeg, Codec::mjpeg, "mjpeg"};
  session.on_resumed(resuming(), jpeg, now);
  ASSERT_EQ(host.opened.size(), 2u);
  EXPECT_EQ(host.opened[1].encoder, EncoderKind::jpeg);
  open_stream();

  pose(1, 0.0f);
  session.on_lost(now);
  auto garden = std::make_shared<SceneEntry>();
  garden->facts.scene_id = std::string("garden");
  jpeg.scene = garden;
  session.on_resumed(resuming(), jpeg, now);
  ASSERT_EQ(host.opened.size(), 3u);
  open_stream();
  EXPECT_EQ(std::get<Welcome>(host.said.back()).scene.scene_id, "garden");
  EXPECT_FALSE(session.next_frame()) << "a pose in the other scene means nothing in this one";
}

TEST_F(SessionLife, IsResumedWhileItsStreamOpens) {
  session.on_message(resuming(), now);
  session.on_lost(now);
  resume();
  EXPECT_EQ(host.count<Welcome>(), 0);
  open_stream();
  EXPECT_EQ(host.opened.size(), 1u);
  EXPECT_EQ(host.count<Welcome>(), 1);
}

TEST_F(SessionLife, GoesOnWhileTheServerDrains) {
  greet();
  pose(1, 0.0f);
  session.say(Drain{5000}, now);
  EXPECT_EQ(std::get<Drain>(host.said.back()).deadline_ms, 5000u);
  EXPECT_FALSE(host.closed);
  ASSERT_TRUE(frame_is_due()) << "the old picture moves until the new server has one";
  run_frame();
  session.end("the server is shutting down");
  EXPECT_EQ(host.closed, CloseCode::going_away);
  EXPECT_FALSE(session.next_frame());
}

}  // namespace
}  // namespace catgs

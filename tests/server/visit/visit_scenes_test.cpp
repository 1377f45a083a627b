// Scenes of a session: another one, one that is loaded first, and what a ray meets in it.

#include "tests/server/visit/visit_fixture.h"
#include "tests/support/test.h"

namespace catgs {
namespace {

using test::VisitTest;

TEST_F(VisitTest, AnotherSceneWelcomesAgain) {
  greet();
  pose(1, 0.0f);
  session.on_message(SelectScene{"b"}, now);
  EXPECT_FALSE(session.next_frame());
  session.on_stream_opened({true, "", Codec::h264, "avc1.42C01F", "libx264"}, now);
  ASSERT_EQ(host.count<Welcome>(), 2);
  EXPECT_EQ(std::get<Welcome>(host.said.back()).scene.scene_id, "b");
  EXPECT_FALSE(session.next_frame()) << "a pose of the old scene shows nothing of the new one";
}

std::shared_ptr<const SceneEntry> scene_of_a_ball() {
  GaussianCloud cloud;
  cloud.resize(1, 0);
  cloud.mean[0] = {0.0f, 0.0f, 3.0f};
  cloud.scale[0] = glm::vec3(0.5f);
  cloud.opacity[0] = 0.9f;
  auto scene = std::make_shared<SceneEntry>();
  ThreadPool pool(1);
  scene->surface = std::make_shared<const SurfacePoints>(cloud, pool);
  return scene;
}

TEST_F(VisitTest, SaysWhatARayMeetsButNotEndlessly) {
  host.admission = Admission{scene_of_a_ball(), {EncoderKind::x264, Codec::h264, "libx264"}};
  greet();
  session.on_message(Pick{5, glm::vec3(0.0f), {0.0f, 0.0f, 1.0f}}, now);
  const auto* picked = std::get_if<Picked>(&host.said.back());
  ASSERT_TRUE(picked);
  EXPECT_EQ(picked->id, 5u);
  EXPECT_EQ(picked->distance, 3.0f);
  session.on_message(Pick{6, glm::vec3(0.0f), {0.0f, 0.0f, -1.0f}}, now);
  EXPECT_FALSE(std::get<Picked>(host.said.back()).distance);
  const auto distance_in = [&](const ClipBox& box) {
    session.on_message(box, now);
    session.on_message(Pick{7, {}, {0.0f, 0.0f, 1.0f}}, now);
    return std::get<Picked>(host.said.back()).distance;
  };
  EXPECT_EQ(distance_in(oriented_box({0, 0, 4}, {1, 0, 0, 0}, {1, 1, 2})), 3.0f);
  EXPECT_FALSE(distance_in(oriented_box({0, 0, 1}, {1, 0, 0, 0}, {1, 1, 1}))) << "behind the box";
  EXPECT_FALSE(distance_in(oriented_box({5, 0, 3}, {1, 0, 0, 0}, {1, 1, 1}))) << "beside the box";
  session.on_message(oriented_box({}, {1, 0, 0, 0}, {1, 1, 1}), now);
  session.on_message(Pick{8, {0.0f, -11.0f, 0.0f}, {1.0f, 1e-38f, 0.0f}}, now);
  EXPECT_FALSE(std::get<Picked>(host.said.back()).distance) << "as good as beside it";
  for (std::uint32_t id = 10; id < 100; ++id)
    session.on_message(Pick{id, {}, {0.0f, 0.0f, 1.0f}}, now);
  EXPECT_EQ(host.count<Picked>(), 32);
  now += 32ms;
  session.on_message(Pick{100, {}, {0.0f, 0.0f, 1.0f}}, now);
  EXPECT_EQ(std::get<Picked>(host.said.back()).id, 100u);
  session.on_message(Pick{101, {}, {0.0f, 0.0f, 1.0f}}, now);
  EXPECT_EQ(host.count<Picked>(), 33);
}

TEST_F(VisitTest, SaysWhichMarkersTheSceneHidesAsTheCameraMoves) {
  host.admission = Admission{scene_of_a_ball(), {EncoderKind::x264, Codec::h264, "libx264"}};
  greet();
  session.on_message(Markers{1, {{0.0f, 0.0f, 9.0f}}}, now);
  session.on_tick(now += 250ms);
  EXPECT_EQ(host.count<HiddenMarkers>(), 0) << "there is no camera yet";
  pose(1, 0.0f);
  ASSERT_EQ(host.count<HiddenMarkers>(), 1);
  EXPECT_EQ(std::get<HiddenMarkers>(host.said.back()).indices, (std::vector<std::uint32_t>{0}));
  now += 250ms;
  pose(2, 8.0f);
  ASSERT_EQ(host.count<HiddenMarkers>(), 2);
  EXPECT_TRUE(std::get<HiddenMarkers>(host.said.back()).indices.empty());
  session.on_message(SelectScene{"b"}, now);
  open_stream();
  for (int tick = 0; tick < 4; ++tick) session.on_tick(now += 250ms);
  EXPECT_EQ(host.count<HiddenMarkers>(), 2) << "another scene has none of them";
}

TEST_F(VisitTest, AHelloWaitsForItsSceneAndIsTold) {
  const AdmissionAnswer admission = std::exchange(host.admission, SceneAwaited{5s});
  say_hello();
  EXPECT_TRUE(host.opened.empty());
  ASSERT_EQ(host.count<QueuePosition>(), 1);
  EXPECT_TRUE(std::get<QueuePosition>(host.said.back()).for_scene);
  EXPECT_EQ(std::get<QueuePosition>(host.said.back()).estimate, 5s);
  for (int tick = 0; tick < 8; ++tick) session.on_tick(now += 250ms);
  EXPECT_EQ(host.count<QueuePosition>(), 3) << "about once a second";
  host.admission = admission;
  session.on_tick(now += 250ms);
  ASSERT_EQ(host.opened.size(), 1u);
  open_stream();
  EXPECT_EQ(host.count<Welcome>(), 1);
  for (int tick = 0; tick < 8; ++tick) session.on_tick(now += 250ms);
  EXPECT_EQ(host.count<QueuePosition>(), 3);
  EXPECT_EQ(host.opened.size(), 1u);
}

TEST_F(VisitTest, AHelloWhoseSceneFailsIsRefused) {
  host.admission = SceneAwaited{5s};
  say_hello();
  host.admission = ErrorMessage{ErrorCode::unknown_scene, "it could not be loaded", false};
  session.on_tick(now += 250ms);
  EXPECT_EQ(host.last_error().code, ErrorCode::unknown_scene);
  EXPECT_EQ(session.life().state(), VisitState::closed);
}

TEST_F(VisitTest, TheOldSceneIsShownWhileTheNextOneIsLoaded) {
  greet();
  pose(1, 0.0f);
  run_frame();
  ack(1);
  host.scene_awaited = true;
  session.on_message(SelectScene{"b"}, now);
  EXPECT_TRUE(std::get<QueuePosition>(host.said.back()).for_scene);
  pose(2, 1.0f);
  now += 1s;
  EXPECT_TRUE(frame_is_due());
  session.on_tick(now += 250ms);
  EXPECT_EQ(host.opened.size(), 1u);
  host.scene_awaited = false;
  session.on_tick(now += 250ms);
  ASSERT_EQ(host.opened.size(), 2u);
  open_stream();
  EXPECT_EQ(std::get<Welcome>(host.said.back()).scene.scene_id, "b");
}

TEST_F(VisitTest, ASceneThatFailsLeadsBackToTheOldOne) {
  greet();
  host.scene_awaited = true;
  session.on_message(SelectScene{"b"}, now);
  host.scene_fails = true;
  session.on_tick(now += 250ms);
  EXPECT_EQ(host.last_error().code, ErrorCode::unknown_scene);
  ASSERT_EQ(host.count<Welcome>(), 2) << "the page shows that it waits";
  EXPECT_EQ(std::get<Welcome>(host.said.back()).scene.scene_id, "a");
  session.on_message(SelectScene{"c"}, now += 250ms);
  EXPECT_FALSE(host.last_error().fatal);
  EXPECT_EQ(host.count<Welcome>(), 2) << "it was not waiting";
}

TEST_F(VisitTest, QuickSelectionsGiveTheLastOneWithTheNextTick) {
  greet();
  session.on_message(SelectScene{"b"}, now);
  open_stream();
  for (int i = 0; i < 100; ++i) session.on_message(SelectScene{std::to_string(i)}, now += 1ms);
  EXPECT_EQ(host.scenes_looked_for, 1);
  session.on_tick(now += 150ms);
  EXPECT_EQ(host.scenes_looked_for, 2);
  EXPECT_EQ(session.stream().scene()->facts.scene_id, "99");
  session.on_message(SelectScene{"c"}, now);
  EXPECT_EQ(host.scenes_looked_for, 2) << "too soon after the tick's";
  open_stream();
  session.on_tick(now += 250ms);
  EXPECT_EQ(session.stream().scene()->facts.scene_id, "c");
  open_stream();
  session.on_message(SelectScene{"d"}, now += 250ms);
  EXPECT_EQ(session.stream().scene()->facts.scene_id, "d") << "at once";
}

TEST_F(VisitTest, ASelectionOfAnotherSceneEndsTheWait) {
  greet();
  host.scene_awaited = true;
  session.on_message(SelectScene{"b"}, now);
  host.scene_awaited = false;
  session.on_message(SelectScene{"c"}, now += 250ms);
  open_stream();
  for (int tick = 0; tick < 4; ++tick) session.on_tick(now += 250ms);
  EXPECT_EQ(host.opened.size(), 2u);
  EXPECT_EQ(session.stream().scene()->facts.scene_id, "c");
}

}  // namespace
}  // namespace catgs

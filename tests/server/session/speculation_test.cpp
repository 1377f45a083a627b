// What a Session asks of key frames and sub-frames.

#include "tests/server/session/session_fixture.h"

namespace catgs {
namespace {

using namespace std::chrono_literals;
using test::SessionTest;

// Samples of the client's clock, 1/60 s apart, 0.1 further along x each.
TEST_F(SessionTest, ForecastsFromPastPosesAlone) {
  greet();
  const auto walk = [&](std::uint64_t id) {
    PoseSample sample;
    sample.pose_id = id;
    sample.client_time_us = static_cast<std::int64_t>(id) * 16'667;
    sample.world_from_camera.position.x = 0.1f * static_cast<float>(id);
    sample.fov_y_rad = 1.0f;
    session.on_message(sample, now);
  };
  walk(1);
  EXPECT_FALSE(run_frame().request.forecast);  // nothing is known of the motion
  FrameOrder order;
  for (std::uint64_t id = 2; id <= 30; ++id) {
    now += 17ms;
    ack(id - 1);
    walk(id);
    order = run_frame();
  }
  ASSERT_TRUE(order.request.forecast);
  const Forecast& forecast = *order.request.forecast;
  EXPECT_EQ(forecast.frames, SpeculationSettings{}.initial_window);
  // As far in so many frames of the rate that the session reaches as it came in as many samples.
  const float step =
      (forecast.world_from_camera.position.x - order.request.camera.world_from_camera.position.x) /
      static_cast<float>(forecast.frames);
  EXPECT_NEAR(step * static_cast<float>(order.real_fps), 0.1f * 60.0f, 0.1f);

  session.on_message(SelectScene{"another"}, now);
  open_stream();
  walk(31);
  EXPECT_FALSE(run_frame().request.forecast);  // elsewhere
}

class AimTest : public SessionTest {
 protected:
  /// Samples of the client's clock, 1/60 s apart, 0.1 further along x each, all shown that late.
  FrameOrder walk(std::uint64_t count, std::chrono::microseconds pose_to_photon) {
    FrameOrder order;
    for (std::uint64_t i = 0; i < count; ++i) {
      sample_.pose_id += 1;
      sample_.client_time_us += 16'667;
      sample_.world_from_camera.position.x += 0.1f;
      sample_.fov_y_rad = 1.0f;
      now += 17ms;
      session.on_message(sample_, now);
      order = run_frame();
      ack(order.ticket.frame_id, static_cast<std::uint32_t>(pose_to_photon.count()));
    }
    return order;
  }
  /// How far ahead of its pose a frame was rendered, in steps of the walk.
  [[nodiscard]] float steps_ahead(const FrameOrder& order) const {
    return (order.ticket.render_pose.position.x - sample_.world_from_camera.position.x) / 0.1f;
  }

  PoseSample sample_;
};

TEST_F(AimTest, RendersWhereTheCameraWillBeWhenThePictureIsSeen) {
  greet();
  EXPECT_NEAR(steps_ahead(walk(60, 0ms)), 0.0f, 0.01f);
  EXPECT_NEAR(steps_ahead(walk(120, 50ms)), 3.0f, 0.2f);
  EXPECT_NEAR(steps_ahead(walk(120, 1s)), 6.0f, 0.4f) << "100 ms at most";
}

TEST_F(AimTest, APictureThatStaysIsOfThePoseItself) {
  greet();
  const FrameOrder moving = walk(60, 50ms);
  ASSERT_GT(steps_ahead(moving), 1.0f);
  EXPECT_FALSE(frame_is_due());  // the camera may still move
  now += policy.still_after + 17ms;
  ASSERT_TRUE(frame_is_due());
  const FrameOrder order = run_frame();
  EXPECT_FALSE(order.ticket.refined);
  EXPECT_EQ(steps_ahead(order), 0.0f);
  EXPECT_FALSE(order.request.forecast) << "hence a key frame";
  ack(order.ticket.frame_id, 50'000);
  now += 70ms;
  ASSERT_TRUE(frame_is_due());
  EXPECT_TRUE(run_frame().ticket.refined);
}

TEST_F(SessionTest, APictureThatStaysIsAKeyFrame) {
  greet();
  pose(1, 0.0f);
  FrameOrder order = session.start_frame(now);
  order.ticket.speculated = true;  // the core drew a sub-frame
  finish(order);
  ack(order.ticket.frame_id);
  EXPECT_FALSE(frame_is_due());  // the camera may still move
  now += policy.still_after + 17ms;
  ASSERT_TRUE(frame_is_due());
  const FrameOrder again = run_frame();
  EXPECT_FALSE(again.ticket.refined);
  EXPECT_FALSE(again.request.forecast);  // hence a key frame
  ack(again.ticket.frame_id);
  now += 70ms;
  ASSERT_TRUE(frame_is_due());
  EXPECT_TRUE(run_frame().ticket.refined);
}

}  // namespace
}  // namespace catgs

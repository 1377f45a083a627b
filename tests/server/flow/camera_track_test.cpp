#include "server/flow/camera_track.h"

#include "tests/support/test.h"

namespace catgs {
namespace {

/// A tour along x at one unit a second.
PoseSample on_tour(std::int64_t time_us) {
  PoseSample sample;
  sample.pose_id = static_cast<std::uint64_t>(time_us / 1000 + 1);
  sample.client_time_us = time_us;
  sample.world_from_camera.position.x = 1e-6f * static_cast<float>(time_us);
  sample.fov_y_rad = 1.0f;
  return sample;
}

PosePath tour() {
  PosePath path;
  for (std::int64_t time = 0; time <= 2'000'000; time += 100'000)
    path.samples.push_back(on_tour(time));
  return path;
}

TEST(CameraTrack, AimsAlongATourFromItsFirstPose) {
  CameraTrack track;
  track.follow(tour());
  ASSERT_TRUE(track.add(on_tour(500'000), 80ms));
  EXPECT_NEAR(track.aim().world_from_camera.position.x, 0.58f, 1e-4f);
  EXPECT_EQ(track.aim().pose_id, 501u) << "it is the newest pose's picture";
  track.aim_at_newest();
  EXPECT_FLOAT_EQ(track.aim().world_from_camera.position.x, 0.5f);
}

TEST(CameraTrack, OldPosesChangeNothing) {
  CameraTrack track;
  ASSERT_TRUE(track.add(on_tour(1'000'000), 0ms));
  EXPECT_FALSE(track.add(on_tour(500'000), 0ms));
  EXPECT_EQ(track.newest()->client_time_us, 1'000'000);
}

TEST(CameraTrack, APageThatWasLoadedAnewCountsAnew) {
  CameraTrack track;
  track.follow(tour());
  track.add(on_tour(1'000'000), 80ms);
  track.begin_anew();
  EXPECT_FALSE(track.newest());
  EXPECT_TRUE(track.add(on_tour(500'000), 80ms));
  EXPECT_FLOAT_EQ(track.aim().world_from_camera.position.x, 0.5f) << "the tour was in other times";
}

}  // namespace
}  // namespace catgs

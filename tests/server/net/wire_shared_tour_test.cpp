// Messages of shared tours, portals and clipping.

#include "tests/server/net/wire_messages.h"
#include "tests/support/test.h"

namespace catgs {
namespace {

TEST(WireSharedTour, BoundsThePlaceOfAPingAndTheNameOfAScene) {
  v1::ClientMessage message;
  message.mutable_ping()->mutable_place()->set_z(-4.0f);
  EXPECT_EQ(parsed<Ping>(message).place.z, -4.0f);
  for (const float bad :
       {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(), 2e9f}) {
    message.mutable_ping()->mutable_place()->set_z(bad);
    EXPECT_EQ(wrong_field(message), "ping.place.z");
  }
  message.mutable_prepare()->set_scene_id(std::string(129, 'a'));
  EXPECT_EQ(wrong_field(message), "prepare.scene_id");
  message.mutable_prepare()->set_scene_id("hall");
  EXPECT_EQ(parsed<Prepare>(message).scene_id, "hall");
}

TEST(WireClip, IsAPlaneOfFiniteNumbers) {
  v1::ClientMessage message;
  message.mutable_clip()->mutable_normal()->set_y(2.0f);
  message.mutable_clip()->set_offset(-3.0f);
  EXPECT_EQ(parsed<ClipBox>(message), clip_plane({0, 2, 0}, -3));
  message.mutable_clip()->mutable_normal()->set_y(0.0f);
  EXPECT_EQ(parsed<ClipBox>(message), ClipBox{}) << "without a normal, all are drawn";
  message.mutable_clip()->mutable_normal()->set_x(std::numeric_limits<float>::quiet_NaN());
  EXPECT_EQ(wrong_field(message), "clip.normal.x");
  message.mutable_clip()->mutable_normal()->set_x(0.0f);
  message.mutable_clip()->set_offset(std::numeric_limits<float>::infinity());
  EXPECT_EQ(wrong_field(message), "clip.offset");
}

TEST(WireClip, BoxesHaveAPoseAndSides) {
  v1::ClientMessage message;
  auto& box = *message.mutable_clip()->mutable_box();
  box.mutable_world_from_box()->mutable_position()->set_x(3.0f);
  EXPECT_EQ(wrong_field(message), "clip.box.orientation");
  box.mutable_world_from_box()->mutable_orientation()->set_w(1.0f);
  for (const auto set : {&v1::Vec3::set_x, &v1::Vec3::set_y, &v1::Vec3::set_z})
    (box.mutable_half_extent()->*set)(2.0f);
  const ClipBox parsed_box = parsed<ClipBox>(message);
  EXPECT_EQ(parsed_box, oriented_box({3, 0, 0}, {1, 0, 0, 0}, {2, 2, 2}));
  EXPECT_EQ(parsed_box.low, glm::vec3(1, -2, -2));
  for (const float bad : {0.0f, 1e-7f, -1.0f, 2e9f, std::numeric_limits<float>::quiet_NaN()}) {
    box.mutable_half_extent()->set_y(bad);
    EXPECT_EQ(wrong_field(message), "clip.box.half_extent.y");
  }
}

TEST(WirePose, ViewsOfParallelRaysHaveAHeight) {
  v1::ClientMessage message;
  auto& pose = *message.mutable_pose();
  pose.set_fov_y_rad(1.0f);
  pose.mutable_world_from_camera()->mutable_orientation()->set_w(1.0f);
  EXPECT_EQ(parsed<PoseSample>(message).view_height, 0.0f);
  pose.set_view_height(12.0f);
  EXPECT_EQ(parsed<PoseSample>(message).view_height, 12.0f);
  for (const float bad : {1e-7f, -1.0f, 2e9f, std::numeric_limits<float>::quiet_NaN()}) {
    pose.set_view_height(bad);
    EXPECT_EQ(wrong_field(message), "pose.view_height");
  }
}

TEST(WireSharedTour, ShownStopsAreThoseThatToursMayHave) {
  v1::ClientMessage message;
  message.mutable_show()->set_tour(32);
  message.mutable_show()->set_stop(256);
  EXPECT_EQ(parsed<Show>(message), (Show{32, 256, false}));
  message.mutable_show()->set_stop(257);
  EXPECT_EQ(wrong_field(message), "show.stop");
  message.mutable_show()->set_tour(33);
  EXPECT_EQ(wrong_field(message), "show.tour");
}

TEST(WireMarkers, AreAtMostSoManyPointsAndFinite) {
  v1::ClientMessage message;
  for (int i = 0; i < 256; ++i) message.mutable_markers()->add_points()->set_x(1.0f);
  message.mutable_markers()->set_id(9);
  EXPECT_EQ(parsed<Markers>(message).id, 9u);
  EXPECT_EQ(parsed<Markers>(message).points.size(), 256u);
  message.mutable_markers()->mutable_points(7)->set_y(std::numeric_limits<float>::infinity());
  EXPECT_EQ(wrong_field(message), "markers.points.y");
  message.mutable_markers()->mutable_points(7)->set_y(0.0f);
  message.mutable_markers()->add_points();
  EXPECT_EQ(wrong_field(message), "markers.points");
  const OutgoingMessage hidden = wire::serialize(HiddenMarkers{9, {0, 200}});
  EXPECT_EQ(hidden.topic, Topic::markers);
  EXPECT_EQ(hex(hidden.bytes),
            "01"
            "6207"
            "0809"
            "120300c801");
}

TEST(WireSharedTour, ListsThePositionsOfParticipants) {
  EXPECT_EQ(wire::serialize(Pinged{}).topic, Topic::ping);
  EXPECT_EQ(wire::serialize(Participants{}).topic, Topic::participants);
  EXPECT_EQ(hex(wire::serialize(Pinged{{1.0f, 0.0f, 0.0f}, true}).bytes),
            "01"
            "5209"
            "0a050d0000803f"
            "1001");
  EXPECT_EQ(hex(wire::serialize(Participants{{{1.0f, 0.0f, 0.0f}, {}}}).bytes),
            "01"
            "5a09"
            "0a050d0000803f"
            "0a00");
}

}  // namespace
}  // namespace catgs

// Two eyes on the wire: what clients ask for, and what frames say.
#include <limits>

#include "server/net/wire.h"
#include "tests/server/net/wire_messages.h"
#include "tests/support/test.h"

namespace catgs {
namespace {

void set(v1::Eye& eye, float right_of_pose, float left, float right) {
  eye.set_right_of_pose(right_of_pose);
  eye.set_below_pose(0.01f);
  eye.set_left(left);
  eye.set_right(right);
  eye.set_up(-0.8f);
  eye.set_down(0.9f);
}

v1::ClientMessage good_settings() {
  v1::ClientMessage message;
  auto& settings = *message.mutable_settings();
  settings.set_width_px(1280);
  settings.set_height_px(640);
  set(*settings.mutable_stereo()->mutable_left(), -0.03f, -1.2f, 0.7f);
  set(*settings.mutable_stereo()->mutable_right(), 0.03f, -0.7f, 1.2f);
  return message;
}

const Stereo eyes{Eye{{-0.03f, 0.01f}, {-1.2f, -0.8f}, {0.7f, 0.9f}},
                  Eye{{0.03f, 0.01f}, {-0.7f, -0.8f}, {1.2f, 0.9f}}};

TEST(WireStereo, SettingsAskForTwoEyes) {
  EXPECT_EQ(parsed<Settings>(good_settings()).stereo, eyes);
  v1::ClientMessage hello;
  hello.mutable_hello()->set_viewport_width_px(640);
  hello.mutable_hello()->set_viewport_height_px(360);
  EXPECT_FALSE(parsed<Hello>(hello).settings.stereo);
  *hello.mutable_hello()->mutable_settings() = good_settings().settings();
  EXPECT_EQ(parsed<Hello>(hello).settings.stereo, eyes);
}

TEST(WireStereo, BadEyesAreNamed) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const auto named = [](auto change) {
    v1::ClientMessage message = good_settings();
    change(*message.mutable_settings());
    return wrong_field(message);
  };
  const auto left = [](v1::Settings& s) -> v1::Eye& { return *s.mutable_stereo()->mutable_left(); };
  const auto right = [](v1::Settings& s) -> v1::Eye& {
    return *s.mutable_stereo()->mutable_right();
  };
  EXPECT_EQ(named([&](auto& s) { left(s).set_right_of_pose(nan); }),
            "settings.stereo.left.right_of_pose");
  EXPECT_EQ(named([&](auto& s) { right(s).set_below_pose(1.1e9f); }),
            "settings.stereo.right.below_pose");
  EXPECT_EQ(named([&](auto& s) { left(s).set_left(-10.1f); }), "settings.stereo.left.left");
  EXPECT_EQ(named([&](auto& s) { left(s).set_right(-1.2f); }), "settings.stereo.left.right");
  EXPECT_EQ(named([&](auto& s) { right(s).set_up(nan); }), "settings.stereo.right.up");
  EXPECT_EQ(named([&](auto& s) { right(s).set_down(-0.9f); }), "settings.stereo.right.down");
  EXPECT_EQ(named([&](auto& s) { s.mutable_stereo()->clear_right(); }),
            "settings.stereo.right.right")
      << "an eye that is missing sees nothing";
  EXPECT_EQ(named([&](auto& s) { s.set_width_px(1281); }), "settings.width_px");
  EXPECT_EQ(named([&](auto& s) {
              s.set_still_width_px(1281);
              s.set_still_height_px(640);
            }),
            "settings.still_width_px");
}

TEST(WireStereo, EyesOnTheWireCanBeDrawn) {
  v1::ClientMessage message = good_settings();
  auto& eye = *message.mutable_settings()->mutable_stereo()->mutable_left();
  for (const float low : {-10.0f, -1.0f, 0.0f, 9.9f}) {
    eye.set_left(low);
    eye.set_right(low + 0.0021f);
    EXPECT_EQ(wrong_field(message), "") << low;
    EXPECT_TRUE(is_valid(parsed<Settings>(message).stereo->front())) << low;
  }
}

TEST(WireStereo, FramesSayWhatTheyShow) {
  const auto header_of = [](const FrameTicket& ticket) {
    std::vector<std::byte> bytes;
    wire::append_frame_header(ticket, nullptr, TimePoint{} + 1s, bytes);
    v1::FrameHeader header;
    EXPECT_LT(static_cast<int>(bytes[1]), 0x80) << "the varint has a byte";
    EXPECT_TRUE(header.ParseFromArray(bytes.data() + 2, static_cast<int>(bytes.size()) - 2));
    return header;
  };
  FrameTicket ticket;
  ticket.render = ticket.encode = {TimePoint{}, TimePoint{}};
  EXPECT_FALSE(header_of(ticket).has_stereo());
  ticket.stereo = eyes;
  const v1::FrameHeader header = header_of(ticket);
  EXPECT_EQ(header.stereo().SerializeAsString(),
            good_settings().settings().stereo().SerializeAsString());
}

}  // namespace
}  // namespace catgs

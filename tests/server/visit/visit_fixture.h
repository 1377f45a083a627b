#pragma once

// A Visit with a fake clock and a fake server around it.

#include "server/visit/visit.h"
#include "tests/server/visit/fake_host.h"
#include "tests/support/test.h"

namespace catgs::test {

class VisitTest : public testing::Test {
 protected:
  VisitTest() {
    host.admission = Admission{named_scene("a"), {EncoderKind::x264, Codec::h264, "libx264"}};
  }

  void greet(Settings settings = {}) {
    say_hello(settings);
    open_stream();
  }
  void say_hello(Settings settings = {}) {
    Hello hello;
    hello.version = 1;
    hello.viewport_px = {640, 361};
    hello.decoders = {Codec::h264};
    hello.settings = settings;
    session.on_message(hello, now);
  }
  void open_stream() {
    session.on_stream_opened({true, "", Codec::h264, "avc1.42C01F", "libx264"}, now);
  }
  void pose(std::uint64_t id, float x) {
    PoseSample sample;
    sample.pose_id = id;
    sample.world_from_camera.position.x = x;
    sample.fov_y_rad = 1.0f;
    session.on_message(sample, now);
  }
  bool frame_is_due() const {
    const auto candidate = session.next_frame();
    return candidate && candidate->ready <= now;
  }
  /// Starts and ends one frame; returns its order.
  FrameOrder run_frame(bool leaves = true) {
    const FrameOrder order = session.start_frame(now);
    finish(order, leaves);
    return order;
  }
  /// `leaves`: through the socket, if it is not dropped.
  void finish(const FrameOrder& order, bool leaves = true) {
    FrameResult result;
    result.ok = true;
    result.frame.ticket = order.ticket;
    result.frame.ticket.idr = order.force_idr;
    result.frame.ticket.render = result.frame.ticket.encode = {now, now};
    result.frame.bitstream.resize(100);
    result.codec_string = "avc1.42C01F";
    result.sharp = sharp;
    const bool dropped = std::ranges::count(host.drop_next, order.ticket.frame_id) > 0;
    session.on_frame(std::move(result), now);
    if (leaves && !dropped) session.statistics().frame_sent(100);
  }
  void ack(std::uint64_t id) {
    Ack message;
    message.frame_id = id;
    message.presented_us = 1;
    session.on_message(message, now);
  }

  bool sharp = false;  // what the encoder says of its pictures
  TimePoint now = TimePoint{} + 1h;
  VisitPolicy policy;
  FakeHost host;
  Visit session{policy, host, now};
};

}  // namespace catgs::test

#pragma once

// A Session with a fake clock and a fake server around it.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/session/session.h"

namespace catgs::test {

using namespace std::chrono_literals;

struct FakeHost final : SessionHost {
  AdmissionAnswer admission = Admission{};
  std::vector<ServerMessage> said;
  std::vector<OutgoingFrame> frames;
  std::vector<StreamSettings> opened;
  std::vector<std::uint64_t> drop_next;
  std::optional<CloseCode> closed;
  std::optional<EncoderChoice> other;  // than that of the admission, once

  AdmissionAnswer admit(const Hello&) override { return admission; }
  bool scene_awaited = false;
  int scenes_looked_for = 0;
  SceneAnswer find_scene(const std::string& id) override {
    ++scenes_looked_for;
    if (scene_awaited) return SceneAwaited{5s};
    auto scene = std::make_shared<SceneEntry>();
    scene->facts.scene_id = id;
    return scene;
  }
  std::vector<std::string> scene_ids() override { return {"a"}; }
  std::uint32_t session_count() override { return 1; }
  void sign(Welcome& welcome) override { welcome.resume_token = "again"; }
  void send(const ServerMessage& message) override { said.push_back(message); }
  std::vector<std::uint64_t> send(OutgoingFrame frame) override {
    frames.push_back(std::move(frame));
    return std::exchange(drop_next, {});
  }
  void close(CloseCode code, std::string_view) override { closed = code; }
  void open_stream(StreamSettings settings) override { opened.push_back(std::move(settings)); }
  std::optional<EncoderChoice> other_encoder(Fault) override { return std::exchange(other, {}); }

  template <typename T>
  int count() const {
    return static_cast<int>(std::ranges::count_if(
        said, [](const ServerMessage& m) { return std::holds_alternative<T>(m); }));
  }
  const ErrorMessage& last_error() const {
    for (auto it = said.rbegin(); it != said.rend(); ++it)
      if (const auto* error = std::get_if<ErrorMessage>(&*it)) return *error;
    throw std::logic_error("no error was said");
  }
};

class SessionTest : public testing::Test {
 protected:
  SessionTest() {
    auto scene = std::make_shared<SceneEntry>();
    scene->facts.scene_id =
        std::string("a");  // GCC 12 warns of overlap when "a" itself is assigned
    scene->facts.near_z = 0.2f;
    host.admission = Admission{scene, {EncoderKind::x264, Codec::h264, "libx264"}};
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
  void pose(std::uint64_t id, float x, bool at_rest = false) {
    PoseSample sample;
    sample.pose_id = id;
    sample.world_from_camera.position.x = x;
    sample.fov_y_rad = 1.0f;
    sample.at_rest = at_rest;
    session.on_message(sample, now);
  }
  bool frame_is_due() const {
    const auto candidate = session.next_frame();
    return candidate && candidate->ready <= now;
  }
  /// Starts and ends one frame; returns its order.
  FrameOrder run_frame() {
    const FrameOrder order = session.start_frame(now);
    finish(order);
    return order;
  }
  void finish(const FrameOrder& order) {
    FrameResult result;
    result.ok = true;
    result.frame.ticket = order.ticket;
    result.frame.ticket.idr = order.force_idr;
    result.frame.ticket.render = result.frame.ticket.encode = {now, now};
    const std::size_t bytes = order.ticket.still ? still_bytes : 100;
    result.frame.bitstream.resize(bytes);
    result.codec_string = "avc1.42C01F";
    result.sharp = sharp;
    const bool dropped = std::ranges::count(host.drop_next, order.ticket.frame_id) > 0;
    session.on_frame(std::move(result), now);
    if (!dropped) session.on_frame_sent(order.ticket, bytes);
  }
  void ack(std::uint64_t id, std::uint32_t pose_age_us = 0) {
    Ack message;
    message.frame_id = id;
    message.presented_us = 1;
    message.pose_age_us = pose_age_us;
    session.on_message(message, now);
  }

  bool sharp = false;  // what the encoder says of its pictures
  std::size_t still_bytes = 100;
  TimePoint now = TimePoint{} + 1h;
  SessionPolicy policy;
  FakeHost host;
  Session session{"test", policy, host, now};
};

}  // namespace catgs::test

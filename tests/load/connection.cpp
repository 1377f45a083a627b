#include "tests/load/connection.h"

#include <algorithm>
#include <cmath>

#include <boost/asio/bind_cancellation_slot.hpp>
#include <boost/asio/co_spawn.hpp>
#include <boost/asio/experimental/awaitable_operators.hpp>
#include <boost/asio/redirect_error.hpp>
#include <boost/asio/strand.hpp>
#include <boost/asio/use_awaitable.hpp>

#include "render_core/error.h"
#include "tests/load/pose_replay.h"

namespace catgs::load {
namespace {

namespace asio = boost::asio;
using asio::use_awaitable;

constexpr std::chrono::seconds server_silence{3};
constexpr std::size_t max_outbox = 256;  // two seconds of poses and acks that nobody reads
constexpr std::size_t max_to_decode = 16;

/// Waits until `timer` is cancelled, which is how its event is signalled here.
asio::awaitable<void> signal_of(asio::steady_timer& timer) {
  boost::system::error_code cancelled;
  timer.expires_at(Clock::time_point::max());
  co_await timer.async_wait(asio::redirect_error(use_awaitable, cancelled));
}

asio::awaitable<void> wait_until(Clock::time_point time) {
  asio::steady_timer timer(co_await asio::this_coro::executor, time);
  co_await timer.async_wait(use_awaitable);
}

Clock::time_point clock_time(std::int64_t time_us) {
  return Clock::time_point(std::chrono::microseconds(time_us));
}

SceneHints hints_of(const v1::SceneFacts& scene) {
  SceneHints hints;
  hints.up = from_wire(scene.up());
  hints.start_pose = from_wire(scene.start_pose());
  hints.near_z = scene.near_z();
  hints.limits = {from_wire(scene.limits_min()), from_wire(scene.limits_max())};
  hints.focus = from_wire(scene.focus());
  hints.source = "server";
  return hints;
}

}  // namespace

std::int64_t now_us() {
  return std::chrono::duration_cast<std::chrono::microseconds>(Clock::now().time_since_epoch())
      .count();
}

Connection::Connection(const SessionSettings& settings, SessionContext context, SessionState& state,
                       SessionReport& report, const asio::any_io_executor& executor)
    : settings_(settings),
      context_(context),
      state_(state),
      report_(report),
      channel_(make_channel(executor, settings.url.tls, context.tls)),
      welcomed_(executor),
      outbox_filled_(executor),
      frame_queued_(executor) {}

asio::awaitable<Connection::End> Connection::run() {
  using namespace asio::experimental::awaitable_operators;
  co_await attempt(channel_->connect(settings_.url, server_silence));
  if (failed_) co_return end_;
  say_hello();
  // The first part to end ends the others: the outbox after Bye, any part when the line is dead.
  co_await (attempt(send_poses()) || attempt(write_outbox()) || attempt(read_inbox()) ||
            attempt(decode_frames()));
  co_return end_;
}

/// Turns what a part throws into a counted error.
asio::awaitable<void> Connection::attempt(asio::awaitable<void> part) {
  try {
    co_await std::move(part);
  } catch (const boost::system::system_error& error) {
    failed_ = true;
    const bool expected = bye_said_ || end_ == End::refused;  // that the connection ends
    if (expected || error.code() == asio::error::operation_aborted) co_return;
    report_.stats.error(is_disconnection(error.code())
                            ? "the connection was lost: " + error.code().message()
                            : error.code().message());
  } catch (const InputError& error) {  // no such decoder here, no such script for this scene
    failed_ = true;
    end_ = End::refused;
    report_.stats.error(error.what());
  }
}

void Connection::say(const v1::ClientMessage& message) {
  if (outbox_.size() == max_outbox) {
    outbox_.pop_front();
    report_.stats.error("the server does not read: an outgoing message was dropped");
  }
  outbox_.push_back(message.SerializeAsString());
  outbox_filled_.cancel();
}

void Connection::say_hello() {
  v1::ClientMessage message;
  v1::Hello& hello = *message.mutable_hello();
  hello.set_version(wire_version);
  hello.set_scene_id(settings_.scene_id);
  hello.set_viewport_width_px(static_cast<std::uint32_t>(settings_.size_px.x));
  hello.set_viewport_height_px(static_cast<std::uint32_t>(settings_.size_px.y));
  hello.set_device_pixel_ratio(1.0f);
  hello.add_decoders(v1::CODEC_H264);
  hello.add_decoders(v1::CODEC_MJPEG);
  hello.set_token(settings_.token);
  hello.mutable_settings()->set_max_fps(static_cast<std::uint32_t>(settings_.fps));
  hello.mutable_settings()->set_max_bitrate_kbps(
      static_cast<std::uint32_t>(settings_.max_bitrate_kbps));
  if (!state_.resume_token.empty()) {
    hello.mutable_resume()->set_token(state_.resume_token);
    if (state_.last_pose) *hello.mutable_resume()->mutable_pose() = *state_.last_pose;
  }
  say(message);
}

asio::awaitable<void> Connection::send_poses() {
  while (!trajectory_) co_await signal_of(welcomed_);
  PoseReplay replay(trajectory_, 0);
  replay = PoseReplay(trajectory_, static_cast<std::int64_t>(
                                       settings_.offset * static_cast<double>(replay.span_us())));
  begin_us_ = now_us();
  while (true) {
    const auto due = clock_time(begin_us_ + replay.next_time_us());
    if (due >= settings_.stop) break;
    co_await wait_until(due);
    const std::int64_t now = now_us();
    const Pose* newest = &replay.take();
    while (begin_us_ + replay.next_time_us() <= now) newest = &replay.take();  // as a browser does
    v1::ClientMessage message;
    v1::PoseSample& sample = *message.mutable_pose();
    sample.set_pose_id(state_.next_pose_id++);
    sample.set_client_time_us(now);
    *sample.mutable_world_from_camera() = to_wire(*newest);
    sample.set_fov_y_rad(settings_.fov_y_rad);
    state_.last_pose = sample;
    report_.stats.pose_sent(sample.pose_id(), now);
    say(message);
  }
  co_await wait_until(settings_.stop);
  v1::ClientMessage message;
  message.mutable_bye();
  say(message);
  bye_said_ = true;
  end_ = End::finished;
  co_await wait_until(settings_.stop + std::chrono::seconds(2));  // for the outbox to end it all
}

asio::awaitable<void> Connection::write_outbox() {
  while (true) {
    while (!outbox_.empty()) {
      const std::string message = std::move(outbox_.front());
      outbox_.pop_front();
      co_await channel_->write(message);
    }
    if (bye_said_) break;
    co_await signal_of(outbox_filled_);
  }
  co_await channel_->close();
}

asio::awaitable<void> Connection::read_inbox() {
  boost::beast::flat_buffer buffer;
  while (true) {
    co_await channel_->read(buffer);
    const auto data = buffer.cdata();
    const auto parsed =
        parse_server_message({static_cast<const std::byte*>(data.data()), data.size()});
    if (const auto* frame = std::get_if<FrameMessage>(&parsed)) {
      take_frame(*frame);
    } else if (const auto* message = std::get_if<v1::ServerMessage>(&parsed)) {
      take_message(*message);
    } else {
      report_.stats.error("the server sent " + std::get<WireError>(parsed).what);
    }
  }
}

void Connection::take_message(const v1::ServerMessage& message) {
  if (message.has_welcome()) take_welcome(message.welcome());
  if (message.has_config()) report_.encoder = message.config().encoder();
  if (message.has_error()) {
    report_.stats.error("the server says: " + message.error().message().substr(0, 200));
    const auto code = message.error().code();
    const bool transient = code == v1::Error::RENDER_FAILED || code == v1::Error::INTERNAL ||
                           code == v1::Error::SERVER_FULL;
    if (message.error().fatal() && !transient) end_ = End::refused;
  }
}

void Connection::take_welcome(const v1::Welcome& welcome) {
  state_.resume_token = welcome.resume_token();
  report_.renderer = welcome.renderer();
  report_.encoder = welcome.config().encoder();
  report_.server_version = welcome.server_version();
  trajectory_ = settings_.make_trajectory(hints_of(welcome.scene()));
  report_.stats.started(now_us());
  welcomed_.cancel();
}

void Connection::take_frame(const FrameMessage& frame) {
  const std::int64_t now = now_us();
  const v1::FrameHeader& header = frame.header;
  report_.stats.frame_received({.frame_id = header.frame_id(),
                                .pose_id = header.pose_id(),
                                .idr = header.idr(),
                                .bytes = frame.bitstream.size(),
                                .wait_us = header.wait_us(),
                                .render_us = header.render_us(),
                                .encode_us = header.encode_us(),
                                .send_us = header.send_wait_us()},
                               now);
  v1::Ack ack;
  ack.set_frame_id(header.frame_id());
  ack.set_received_us(now);
  ack.set_pose_age_us(static_cast<std::uint32_t>(
      std::clamp<std::int64_t>(now - header.pose_client_time_us(), 0, UINT32_MAX)));
  if (settings_.decode) {
    queue_for_decoding(frame, ack);
  } else {
    acknowledge(ack, now);
  }
}

void Connection::acknowledge(v1::Ack ack, std::int64_t presented_us) {
  if (!settings_.acknowledge) return;
  if (!ack.dropped()) {
    ack.set_decoded_us(presented_us);
    ack.set_presented_us(presented_us);
  }
  ack.set_decoder_queue(static_cast<std::uint32_t>(to_decode_.size()));
  v1::ClientMessage message;
  *message.mutable_ack() = ack;
  say(message);
}

void Connection::queue_for_decoding(const FrameMessage& frame, const v1::Ack& ack) {
  const v1::FrameHeader& header = frame.header;
  const bool independent = header.idr() || header.codec() == v1::CODEC_MJPEG;
  if (to_decode_.size() == max_to_decode) wait_for_idr_ = true;
  if (to_decode_.size() == max_to_decode || (wait_for_idr_ && !independent)) {
    ++report_.stats.frames_skipped;
    v1::Ack dropped = ack;
    dropped.set_dropped(true);
    acknowledge(dropped, 0);
    v1::ClientMessage message;
    message.mutable_request_idr();
    say(message);
    return;
  }
  wait_for_idr_ = false;
  to_decode_.push_back(
      {.bitstream = {frame.bitstream.begin(), frame.bitstream.end()},
       .codec = header.codec() == v1::CODEC_MJPEG ? Codec::mjpeg : Codec::h264,
       .idr = header.idr(),
       .size_px = {static_cast<int>(header.width_px()), static_cast<int>(header.height_px())},
       .ack = ack});
  frame_queued_.cancel();
}

asio::awaitable<void> Connection::decode_frames() {
  while (true) {
    while (to_decode_.empty()) co_await signal_of(frame_queued_);
    EncodedMessage message = std::move(to_decode_.front());
    to_decode_.pop_front();
    co_await decode_one(message);
  }
}

asio::awaitable<void> Connection::decode_one(EncodedMessage& message) {
  struct Result {
    EncodeStatus status;
    glm::ivec2 size_px{0};
    std::int64_t duration_us = 0;
  };
  if (decoder_codec_ != message.codec) {
    decoder_ = std::make_unique<Decoder>(message.codec);
    decoder_codec_ = message.codec;
  }
  // On the pool, so that decoding one session delays no other session's time stamps. The end of the
  // run does not cancel it: co_spawn would send the cancellation to the pool's thread, where the
  // picture may be finished and all that it refers to gone.
  const Result result = co_await asio::co_spawn(
      asio::make_strand(context_.decoders),
      [&decoder = *decoder_, &message]() -> asio::awaitable<Result> {
        Result decoded;
        DecodedPicture picture;
        const std::int64_t start = now_us();
        decoded.status = decoder.decode(message.bitstream, picture);
        decoded.duration_us = now_us() - start;
        decoded.size_px = picture.size_px;
        co_return decoded;
      },
      asio::bind_cancellation_slot(asio::cancellation_slot(), use_awaitable));
  v1::Ack ack = message.ack;
  if (!result.status.ok || result.size_px != message.size_px) {
    ++report_.stats.decode_errors;
    report_.stats.error(result.status.ok ? "a decoded picture has another size than its header says"
                                         : "a frame cannot be decoded: " + result.status.message);
    wait_for_idr_ = true;
    ack.set_dropped(true);
    v1::ClientMessage request;
    request.mutable_request_idr();
    say(request);
  } else {
    report_.stats.frame_decoded(result.duration_us);
  }
  acknowledge(ack, now_us());
}

}  // namespace catgs::load

#include "tests/load/connection.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <boost/asio/experimental/awaitable_operators.hpp>
#include <boost/asio/use_awaitable.hpp>
#include <boost/beast/websocket/stream_base.hpp>
#include <glm/geometric.hpp>
#include <glm/trigonometric.hpp>

#include "render_core/base/error.h"
#include "tests/load/pose_replay.h"
#include "tests/load/waiting.h"
#include "tests/load/warp.h"

namespace catgs::load {
namespace {

namespace asio = boost::asio;
using asio::use_awaitable;

constexpr std::chrono::seconds server_silence{3};
constexpr std::size_t max_outbox = 256;  // two seconds of poses and acks that nobody reads

SceneHints hints_of(const v1::SceneFacts& scene) {
  SceneHints hints;
  hints.up = from_wire(scene.up());
  hints.start_pose = from_wire(scene.start_pose());
  hints.near_z = scene.near_z();
  hints.limits = {from_wire(scene.limits_min()), from_wire(scene.limits_max())};
  hints.focus = from_wire(scene.focus());
  hints.origin = {scene.origin().x(), scene.origin().y(), scene.origin().z()};
  hints.source = "server";
  return hints;
}

/// As frame_sizes.ts makes it.
std::uint32_t frame_side(double px) {
  return static_cast<std::uint32_t>(std::clamp(2.0 * std::round(px / 2.0), 16.0, 8192.0));
}

/// The first refresh after `time_us`.
std::int64_t refresh_after(std::int64_t time_us, int hz) {
  return ((time_us * hz / 1'000'000 + 1) * 1'000'000 + hz - 1) / hz;
}

/// Both eyes, in a world of metres.
Stereo eyes_of(const SessionSettings& settings) {
  constexpr float eye_distance = 0.064f;
  const float focal_px =
      focal_from_fov_y(glm::radians(settings.wishes.fov_y_deg), settings.size_px.y);
  return eyes_like(make_camera({}, settings.size_px, focal_px), eye_distance);
}

}  // namespace

Connection::Connection(const SessionSettings& settings, SessionContext context, SessionState& state,
                       SessionReport& report, const asio::any_io_executor& executor)
    : settings_(settings),
      state_(state),
      report_(report),
      channel_(make_channel(executor, settings.url.tls, context.tls)),
      welcomed_(executor),
      outbox_filled_(executor),
      decode_stage_(
          settings, context.decoders, report,
          {.acknowledge = [this](const v1::Ack& ack, std::int64_t time) { show(ack, time); },
           .request_idr =
               [this] {
                 v1::ClientMessage message;
                 message.mutable_request_idr();
                 say(message);
               }},
          executor) {}

asio::awaitable<Connection::End> Connection::run() {
  using namespace asio::experimental::awaitable_operators;
  // While a stalled client does not look, silence means nothing.
  const bool stalls = settings_.stall_to_us > settings_.stall_from_us;
  const Clock::duration silence =
      stalls ? boost::beast::websocket::stream_base::none() : server_silence;
  co_await attempt(channel_->connect(settings_.url, settings_.via_port, silence));
  if (failed_) co_return end_;
  say_hello();
  // The first part to end ends the others: the outbox after Bye, any part when the line is dead.
  co_await (attempt(send_poses()) || attempt(write_outbox()) || attempt(read_inbox()) ||
            attempt(decode_stage_.run()) || attempt(flood()) || attempt(drop_line()) ||
            attempt(refresh_display()));
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

glm::dvec2 Connection::overscan() const {
  return even_overscan(settings_.display.overscan.value_or(state_.overscan.sides()),
                       settings_.size_px);
}

v1::Settings Connection::wanted_settings() const {
  v1::Settings settings;
  const glm::dvec2 sides = overscan();
  const bool smaller = settings_.moving_size_px.x > 0, stereo = settings_.wishes.stereo;
  if (smaller || stereo || sides != glm::dvec2(1.0)) {
    const glm::ivec2 moving_px = smaller ? settings_.moving_size_px : settings_.size_px;
    const double across = stereo ? 2.0 * sides.x : sides.x;
    settings.set_width_px(frame_side(moving_px.x * across));
    settings.set_height_px(frame_side(moving_px.y * sides.y));
    settings.set_still_width_px(frame_side(settings_.size_px.x * across));
    settings.set_still_height_px(frame_side(settings_.size_px.y * sides.y));
  }
  if (stereo) *settings.mutable_stereo() = to_wire(eyes_of(settings_));
  settings.set_max_fps(static_cast<std::uint32_t>(settings_.wishes.fps));
  settings.set_max_bitrate_kbps(static_cast<std::uint32_t>(settings_.wishes.max_bitrate_kbps));
  settings.set_fixed_quality(settings_.wishes.fixed_quality);
  settings.set_depths(settings_.display.depths);
  return settings;
}

void Connection::say_hello() {
  v1::ClientMessage message;
  v1::Hello& hello = *message.mutable_hello();
  hello.set_version(wire_version);
  hello.set_scene_id(settings_.wishes.scene);
  hello.set_viewport_width_px(static_cast<std::uint32_t>(settings_.size_px.x));
  hello.set_viewport_height_px(static_cast<std::uint32_t>(settings_.size_px.y));
  hello.add_decoders(v1::CODEC_H264);
  hello.add_decoders(v1::CODEC_MJPEG);
  hello.set_token(settings_.token);
  *hello.mutable_settings() = wanted_settings();
  if (!state_.resume_token.empty()) {
    hello.mutable_resume()->set_token(state_.resume_token);
    if (state_.last_pose) *hello.mutable_resume()->mutable_pose() = *state_.last_pose;
  }
  hello_us_ = now_us();
  say(message);
}

asio::awaitable<void> Connection::send_poses() {
  while (!trajectory_) co_await signal_of(welcomed_);
  PoseReplay replay(trajectory_, 0);
  replay = PoseReplay(trajectory_, static_cast<std::int64_t>(
                                       settings_.offset * static_cast<double>(replay.span_us())));
  begin_us_ = now_us();
  if (report_.display) begin_us_ = refresh_after(begin_us_, settings_.display.hz);
  std::int64_t moving_since_us = begin_us_;
  const std::int64_t move_us = microseconds(settings_.manners.move_for_s);
  const std::int64_t stay_us = microseconds(settings_.manners.leave_every_s);
  const bool leaves = stay_us > 0 && begin_us_ + stay_us < settings_.stop_us;
  const std::int64_t end_us = leaves ? begin_us_ + stay_us : settings_.stop_us;
  while (true) {
    if (settings_.manners.rest_for_s > 0.0 && now_us() - moving_since_us >= move_us) {
      co_await rest();
      moving_since_us = now_us();
    }
    const std::int64_t due_us = begin_us_ + replay.next_time_us();
    if (due_us >= end_us) break;
    co_await wait_until(clock_time(due_us));
    if (stalled()) {  // the poses meanwhile are never taken
      co_await wait_until(clock_time(settings_.stall_to_us));
      continue;
    }
    const std::int64_t now = now_us();
    const Pose* newest = &replay.take();
    while (begin_us_ + replay.next_time_us() <= now) newest = &replay.take();  // as a browser does
    v1::ClientMessage message;
    v1::PoseSample& sample = *message.mutable_pose();
    sample.set_pose_id(state_.next_pose_id++);
    sample.set_client_time_us(now);
    *sample.mutable_world_from_camera() = to_wire(*newest);
    sample.set_fov_y_rad(widened_fov(glm::radians(settings_.wishes.fov_y_deg), overscan().y));
    state_.last_pose = sample;
    report_.stats.pose_sent(sample.pose_id(), now);
    say(message);
  }
  co_await wait_until(clock_time(end_us));
  v1::ClientMessage message;
  message.mutable_bye();
  say(message);
  bye_said_ = true;
  end_ = leaves ? End::left : End::finished;
  co_await wait_until(clock_time(end_us + 2'000'000));  // for the outbox to end it all
}

/// Behaves like a browser whose visitor stands still: at the next refresh it says that nothing
/// moves. It then sends no poses, and the path continues from here.
asio::awaitable<void> Connection::rest() {
  constexpr std::int64_t refresh_us = 16'667;
  if (!state_.last_pose) co_return;
  const std::int64_t since_us = state_.last_pose->client_time_us();
  const std::int64_t rest_us = microseconds(settings_.manners.rest_for_s);
  const std::int64_t end_us = std::min(now_us() + rest_us, settings_.stop_us);
  report_.rest = {++report_.rests, state_.last_pose->pose_id(), since_us};
  co_await wait_until(clock_time(std::min(since_us + refresh_us, end_us)));
  v1::ClientMessage message;
  *message.mutable_pose() = *state_.last_pose;
  message.mutable_pose()->set_at_rest(true);
  say(message);
  co_await wait_until(clock_time(end_us));
  if (now_us() >= settings_.stop_us) --report_.rests;  // cut short: proves nothing
  report_.rest.reset();
  begin_us_ += rest_us;
}

bool Connection::stalled() const {
  const std::int64_t now = now_us();
  return now >= settings_.stall_from_us && now < settings_.stall_to_us;
}

/// Poses that no client would send so often. They say where the camera is already.
asio::awaitable<void> Connection::flood() {
  constexpr std::int64_t wake_us = 5'000;
  if (settings_.manners.flood_hz == 0) co_await wait_until(Clock::time_point::max());
  while (!state_.last_pose) co_await wait_until(clock_time(now_us() + wake_us));
  std::int64_t sent_us = now_us();
  const std::int64_t interval_us = 1'000'000 / settings_.manners.flood_hz;
  while (true) {
    co_await wait_until(clock_time(sent_us + std::max(wake_us, interval_us)));
    for (const std::int64_t now = now_us(); sent_us < now; sent_us += interval_us) {
      v1::ClientMessage message;
      *message.mutable_pose() = *state_.last_pose;
      say(message);
    }
  }
}

/// Ends the connection without a word at the run's next multiple of reconnect_every_s.
asio::awaitable<void> Connection::drop_line() {
  const std::int64_t every_us = microseconds(settings_.manners.reconnect_every_s);
  if (every_us == 0) co_await wait_until(Clock::time_point::max());
  const std::int64_t since_us = now_us() - settings_.run_begin_us;
  const std::int64_t round = since_us / every_us + 1;
  const std::int64_t drop_us = settings_.run_begin_us + round * every_us;
  co_await wait_until(clock_time(std::min(drop_us, settings_.stop_us)));
  if (drop_us >= settings_.stop_us) co_await wait_until(Clock::time_point::max());
}

asio::awaitable<void> Connection::write_outbox() {
  while (true) {
    while (!outbox_.empty()) {
      if (stalled()) co_await wait_until(clock_time(settings_.stall_to_us));
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
    if (stalled()) co_await wait_until(clock_time(settings_.stall_to_us));
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
                           code == v1::Error::SERVER_FULL || settings_.manners.flood_hz > 0;
    if (message.error().fatal() && !transient) end_ = End::refused;
  }
}

void Connection::take_welcome(const v1::Welcome& welcome) {
  const std::int64_t now = now_us();
  if (state_.resume_token.empty()) report_.stats.durations.admission.add(now - hello_us_);
  state_.resume_token = welcome.resume_token();
  report_.renderer = welcome.renderer();
  report_.encoder = welcome.config().encoder();
  report_.server_version = welcome.server_version();
  decode_stage_.set_scene(welcome.scene());
  focus_ = from_wire(welcome.scene().focus());
  trajectory_ = settings_.make_trajectory(hints_of(welcome.scene()));
  report_.stats.started(now);
  welcomed_.cancel();
}

void Connection::take_frame(const FrameMessage& frame) {
  const std::int64_t now = now_us();
  const v1::FrameHeader& header = frame.header;
  report_.stats.frame_received({.frame_id = header.frame_id(),
                                .pose_id = header.pose_id(),
                                .idr = header.idr(),
                                .bytes = frame.bitstream.size() + header.depth_codes().size(),
                                .pixels = std::uint64_t{header.width_px()} * header.height_px(),
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
  if (decode_stage_.has_work()) {
    decode_stage_.take(frame, ack);
  } else {
    acknowledge(ack, now);
  }
}

void Connection::show(const v1::Ack& ack, std::int64_t decoded_us) {
  if (!report_.display || ack.dropped()) return acknowledge(ack, decoded_us);
  if (undisplayed_) {
    undisplayed_->set_dropped(true);
    acknowledge(*undisplayed_, 0);
  }
  undisplayed_ = ack;
  undisplayed_->set_decoded_us(decoded_us);
}

double Connection::warp_distance(const Pose& camera, const DisplayLog::Frame& frame) const {
  if (settings_.display.warp == WarpMode::off) return 0.0;
  if (frame.depths.cells.x > 0) return median_distance(frame.depths);
  const float to_focus =
      glm::dot(focus_ - camera.position, camera.orientation * glm::vec3(0.0f, 0.0f, 1.0f));
  const bool to_plane = settings_.display.warp == WarpMode::plane && to_focus > 0.0f;
  return to_plane ? to_focus : std::numeric_limits<double>::infinity();
}

/// By the newest refresh of the log, if the camera has moved or a frame has come.
void Connection::choose_overscan() {
  if (settings_.display.overscan) return;
  const DisplayLog& log = *report_.display;
  const DisplayLog::Refresh& refresh = log.refreshes.back();
  const std::size_t before = std::max<std::size_t>(log.refreshes.size(), 2) - 2;
  const bool moved = seen_pose_id_ != state_.last_pose->pose_id();
  if (!moved && log.refreshes[before].frame == refresh.frame) return;
  if (moved) state_.overscan.moved(refresh.time_us, refresh.camera);
  seen_pose_id_ = state_.last_pose->pose_id();
  const Eye& picture = log.frames[refresh.frame].eye;
  const glm::dvec2 size_px = log.frames[refresh.frame].size_px, view_px = log.view_px;
  if (!state_.overscan.drawn(picture, size_px.x / size_px.y, {refresh.camera, log.fov_y_rad},
                             view_px.x / view_px.y, refresh.distance, refresh.time_us))
    return;
  v1::ClientMessage message;
  *message.mutable_settings() = wanted_settings();
  say(message);
}

/// Shows the newest decoded frame at each refresh, right after the camera was sampled. One that
/// comes a whole refresh late is left out, as a browser does.
asio::awaitable<void> Connection::refresh_display() {
  constexpr std::int64_t behind_camera_us = 500;
  const int hz = settings_.display.hz;
  if (!report_.display) co_await wait_until(Clock::time_point::max());
  DisplayLog& log = *report_.display;
  while (true) {
    const std::int64_t due_us = refresh_after(now_us() - behind_camera_us, hz);
    co_await wait_until(clock_time(due_us + behind_camera_us));
    if (log.frames.empty() || !state_.last_pose || stalled()) continue;
    const std::int64_t now = now_us();
    if (log.full) {  // still shown, but not kept
      if (undisplayed_) acknowledge(*std::exchange(undisplayed_, std::nullopt), now);
      continue;
    }
    const Pose camera = from_wire(state_.last_pose->world_from_camera());
    DisplayLog::Refresh refresh{.time_us = now,
                                .frame = log.frames.size() - 1,
                                .camera = camera,
                                .distance = warp_distance(camera, log.frames.back()),
                                .overscan = overscan().y};
    if (report_.rest) {
      refresh.rest = report_.rest->number;
      refresh.after_us = now - report_.rest->since_us;
    }
    log.refreshes.push_back(refresh);
    choose_overscan();
    if (undisplayed_) acknowledge(*std::exchange(undisplayed_, std::nullopt), now);
  }
}

void Connection::acknowledge(v1::Ack ack, std::int64_t presented_us) {
  if (!settings_.manners.acknowledge) return;
  if (!ack.dropped()) {
    if (ack.decoded_us() == 0) ack.set_decoded_us(presented_us);
    ack.set_presented_us(presented_us);
  }
  v1::ClientMessage message;
  *message.mutable_ack() = ack;
  say(message);
}

}  // namespace catgs::load

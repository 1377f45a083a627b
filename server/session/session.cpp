#include "server/session/session.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "render_core/build_info.h"
#include "server/net/wire.h"
#include "server/session/frame_size.h"
#include "server/session/same_view.h"

namespace catgs {
namespace {

using namespace std::chrono_literals;

constexpr auto min_idr_request_interval = 250ms;
constexpr int max_failures_in_a_row = 3;

}  // namespace

FlowWish wish_within(const SessionPolicy& policy, const Settings& settings,
                     glm::ivec2 viewport_px) {
  const int fps = settings.max_fps > 0 ? settings.max_fps : policy.default_fps;
  const int kbps =
      settings.max_bitrate_kbps > 0 ? settings.max_bitrate_kbps : policy.default_bitrate_kbps;
  const glm::ivec2 wish_px = settings.size_px.x > 0 ? settings.size_px : viewport_px;
  return {frame_size(wish_px, policy.max_pixels), std::min(fps, policy.max_fps),
          std::min(kbps, policy.max_bitrate_kbps), settings.fixed_quality};
}

Session::Session(std::string id, const SessionPolicy& policy, SessionHost& host, TimePoint now)
    : id_(std::move(id)),
      policy_(policy),
      host_(host),
      created_(now),
      last_said_(now),
      last_activity_(now),
      picks_(4.0, 4.0, now),
      second_start_(now) {}

void Session::on_message(const ClientMessage& message, TimePoint now) {
  if (state_ == State::closed) return;
  if (state_ == State::queued) return on_queued(message);
  const bool is_hello = std::holds_alternative<Hello>(message);
  if (std::holds_alternative<Bye>(message) || std::holds_alternative<UnknownMessage>(message) ||
      is_hello == (state_ == State::awaiting_hello))
    std::visit([&](const auto& body) { on(body, now); }, message);
  else
    on_bad_message(is_hello ? "a second hello" : "the first message has to be a hello");
}

void Session::on_bad_message(std::string_view what) { fail(ErrorCode::bad_message, what); }

void Session::fail(ErrorCode code, std::string_view message) {
  if (state_ == State::closed) return;
  state_ = State::closed;
  host_.send(ErrorMessage{code, std::string(message), true});
  const bool later = code == ErrorCode::server_full || code == ErrorCode::internal;
  host_.close(later ? CloseCode::try_again_later : CloseCode::policy_violation, message);
}

void Session::note_activity(TimePoint now) {
  last_activity_ = now;
  idle_warned_ = false;
}

void Session::on(const Hello& hello, TimePoint now) {
  note_activity(now);
  if (hello.version < wire::version)
    return fail(ErrorCode::unsupported_version,
                fmt::format("this server speaks catgs wire version {}, the client at most {}: "
                            "reload the page or update the client",
                            wire::version, hello.version));
  greet(hello, now);
}

void Session::greet(const Hello& hello, TimePoint now) {
  auto answer = host_.admit(hello);
  if (const auto* error = std::get_if<ErrorMessage>(&answer))
    return fail(error->code, error->message);
  awaited_scene_.reset();
  if (const auto* place = std::get_if<QueuePlace>(&answer)) {
    waiting_hello_ = hello;
    state_ = State::queued;
    return on_queue_moved(*place, now);
  }
  if (const auto* awaited = std::get_if<SceneAwaited>(&answer)) {
    waiting_hello_ = hello;
    state_ = State::queued;
    return await_scene(hello.scene_id, *awaited, now);
  }
  note_activity(now);
  admission_.encoder = std::get<Admission>(answer).encoder;
  enter_scene(std::get<Admission>(answer).scene);
  viewport_px_ = hello.viewport_px;
  settings_ = hello.settings;
  state_ = State::opening;
  if (hello.resume_pose) on(*hello.resume_pose, now);
  request_stream();
}

void Session::on_queued(const ClientMessage& message) {
  if (const auto* settings = std::get_if<Settings>(&message)) waiting_hello_.settings = *settings;
  if (const auto* pause = std::get_if<Pause>(&message)) paused_ = pause->paused;
  if (std::holds_alternative<Hello>(message)) on_bad_message("a second hello");
  if (const auto* bye = std::get_if<Bye>(&message)) on(*bye, {});
}

void Session::on_lost(TimePoint now) {
  lost_at_ = now;
  obsolete_frames_ = frames_started_;
  flow_.forget_in_flight();
}

void Session::on_resumed(const Hello& hello, Admission admission, TimePoint now) {
  lost_at_.reset();
  obsolete_frames_ = frames_started_;
  flow_.forget_path();
  note_activity(now);
  paused_ = false;  // a page that is still hidden says so again
  idr_due_ = true;
  idr_request_waits_ = false;
  const bool same_stream = admission.scene == admission_.scene &&
                           admission.encoder.kind == admission_.encoder.kind &&
                           hello.settings == settings_ && hello.viewport_px == viewport_px_;
  admission_.encoder = std::move(admission.encoder);
  if (admission.scene != admission_.scene) enter_scene(std::move(admission.scene));
  welcome_due_ = true;
  viewport_px_ = hello.viewport_px;
  settings_ = hello.settings;
  if (hello.resume_pose) {
    pose_.reset();  // its numbers begin anew when the page does
    on(*hello.resume_pose, now);
  }
  if (!same_stream)
    request_stream();
  else if (state_ == State::live && !opening_stream_)
    say_config(now);
}

void Session::on(const PoseSample& sample, TimePoint now) {
  // Ids increase; an older sample has been overtaken.
  if (pose_ && sample.pose_id <= pose_->pose_id) return;
  if (!pose_ || !same_view(*pose_, sample, admission_.scene->facts.near_z)) {
    note_activity(now);
    last_motion_ = now;
  }
  pose_ = sample;
  pose_received_ = now;
  forecast_.add({sample.client_time_us, sample.world_from_camera});
  // What is drawn now is seen as much later as pictures have come after their poses lately.
  aimed_ahead_us_ = flow_.pose_to_photon().count();
  aim_ = sample;
  if (const auto ahead = forecast_.at(sample.client_time_us + aimed_ahead_us_))
    aim_.world_from_camera = *ahead;
}

void Session::on(const Pick& pick, TimePoint now) {
  note_activity(now);
  if (picks_.take(now)) say(admission_.scene->seen_along(pick), now);
}

void Session::on(const Ack& ack, TimePoint now) {
  const bool held_back = !flow_.may_send();
  if (!flow_.acknowledged(ack, now)) return;
  if (ack.dropped) ++frames_dropped_;
  if (held_back && flow_.may_send()) credit_since_ = now;
}

void Session::on(const Settings& settings, TimePoint now) {
  note_activity(now);
  settings_ = settings;
  request_stream();
}

void Session::on(const RequestIdr&, TimePoint now) {
  // A decoder that failed twice needs the second one as well, only later.
  idr_request_waits_ = now - last_idr_request_ < min_idr_request_interval;
  if (idr_request_waits_) return;
  last_idr_request_ = now;
  idr_due_ = true;
}

void Session::on(const Pause& pause, TimePoint now) {
  note_activity(now);
  if (paused_ && !pause.paused) {
    // A hidden page presents nothing, so its frames in flight were never acknowledged.
    flow_.forget_in_flight();
    idr_due_ = true;
  }
  paused_ = pause.paused;
}

void Session::on(const Bye&, TimePoint) {
  state_ = State::closed;
  host_.close(CloseCode::normal, "bye");
}

void Session::request_stream() {
  if (opening_stream_ || rendering_) {
    stream_outdated_ = true;
    return;
  }
  opening_stream_ = true;
  stream_outdated_ = false;
  const FlowWish wish = flow_wish();
  flow_.set_wish(wish);
  EncoderSettings encoding;
  encoding.size_px = scaled_size(wish.size_px, flow_.rung().scale);
  encoding.fps = wish.fps;
  encoding.bitrate_kbps = wish.bitrate_kbps;
  config_.size_px = encoding.size_px;
  config_.fps = encoding.fps;
  config_.bitrate_kbps = encoding.bitrate_kbps;
  host_.open_stream({admission_.scene->renderer, admission_.encoder.kind, encoding});
}

FlowWish Session::flow_wish() const { return wish_within(policy_, settings_, viewport_px_); }

void Session::on_stream_opened(const StreamOpened& opened, TimePoint now) {
  opening_stream_ = false;
  if (state_ == State::closed) return;
  if (!opened.ok)
    return fail(ErrorCode::internal, "the stream cannot be opened: " + opened.message);
  if (stream_outdated_) return request_stream();
  config_.codec = opened.codec;
  config_.codec_string = opened.codec_string;
  config_.encoder = admission_.encoder.text;
  device_ = opened.device;
  state_ = State::live;
  idr_due_ = true;
  say_config(now);
}

void Session::say_config(TimePoint now) {
  if (std::exchange(welcome_due_, false)) return say(welcome(), now);
  say(config_, now);
}

Welcome Session::welcome() {
  Welcome welcome;
  welcome.session_id = id_;
  welcome.scene = admission_.scene->facts;
  welcome.config = config_;
  welcome.renderer = admission_.scene->renderer_text;
  welcome.server_version = build_version;
  welcome.scene_ids = host_.scene_ids();
  host_.sign(welcome);
  return welcome;
}

bool Session::picture_is_stale() const {
  return idr_due_ || !shown_ || !same_view(*shown_, aim_, admission_.scene->facts.near_z);
}

std::optional<FrameCandidate> Session::next_frame() const {
  if (state_ != State::live || lost_at_ || paused_ || rendering_ || opening_stream_ || !pose_ ||
      !flow_.may_send())
    return std::nullopt;
  FrameCandidate frame{next_start_, {}, cost_.next(), cost_.key_is_next(), device_};
  if (!picture_is_stale()) {
    if (refinements_left_ == 0 && !shown_is_passing_) return std::nullopt;
    // Between two poses of a moving camera a refinement would only be in the next one's way.
    frame.ready = std::max(frame.ready, last_motion_ + policy_.still_after);
    frame.key = shown_is_passing_;
    if (!frame.key) frame.cost = cost_.refinement();
  }
  frame.deadline = frame.ready + flow_.frame_interval();
  return frame;
}

FrameOrder Session::start_frame(TimePoint now) {
  const int real_fps = measure_rate(now);
  // The nominal rate is kept on average; what is lost is not caught up.
  next_start_ = std::max(next_start_, now - flow_.frame_interval()) + flow_.frame_interval();
  rendering_ = true;
  FrameOrder order;
  const bool still = !picture_is_stale();
  // What stays is a key frame of the pose itself: a sub-frame may lack a little at the edges of
  // tiles, and a forecast goes further than a camera that stops.
  order.ticket.refined = still && !shown_is_passing_;
  if (still) aim_ = *pose_;
  order.force_idr = std::exchange(idr_due_, false);
  order.bitrate_kbps = flow_.bitrate_kbps();
  order.real_fps = real_fps;
  shown_is_passing_ = !same_view(aim_, *pose_, admission_.scene->facts.near_z);
  if (order.ticket.refined)
    --refinements_left_;
  else
    refinements_left_ = config_.codec == Codec::h264 ? policy_.refine_frames : 0;
  shown_ = aim_;

  const Pose& pose = aim_.world_from_camera;
  order.ticket.frame_id = ++frames_started_;
  order.ticket.pose_id = pose_->pose_id;
  order.ticket.pose_client_time_us = pose_->client_time_us;
  order.ticket.render_pose = pose;
  order.ticket.fov_y_rad = pose_->fov_y_rad;
  order.ticket.size_px = config_.size_px;
  order.ticket.pose_received = pose_received_;
  order.request.camera =
      make_camera(pose, config_.size_px, focal_from_fov_y(pose_->fov_y_rad, config_.size_px.y),
                  admission_.scene->facts.near_z);
  if (!still)
    order.request.forecast = forecast_.forecast(pose_->client_time_us + aimed_ahead_us_, real_fps,
                                                SpeculationSettings{}.initial_window);
  return order;
}

int Session::measure_rate(TimePoint now) {
  // Over about eight frames. A longer gap is a pause of the motion, not a slow renderer.
  constexpr auto longest_interval = 500ms;
  std::chrono::duration<double> interval = now - std::exchange(last_start_, now);
  // It waited for credit: larger frames would make it wait longer.
  if (credit_since_ > next_start_) interval = flow_.frame_interval();
  if (interval < longest_interval) {
    mean_interval_ += (interval - mean_interval_) / 8.0;
    flow_.set_real_interval(std::chrono::duration_cast<std::chrono::microseconds>(mean_interval_));
  }
  const double fps = 1.0 / std::max(mean_interval_.count(), 1e-3);
  return std::clamp(static_cast<int>(std::lround(fps)), 1, config_.fps);
}

void Session::on_frame(FrameResult result, TimePoint now) {
  rendering_ = false;
  if (state_ == State::closed) return;
  if (stream_outdated_) request_stream();
  if (!result.ok) {
    shown_.reset();
    idr_due_ = true;
    if (++failures_ >= max_failures_in_a_row)
      fail(ErrorCode::render_failed, "rendering failed: " + result.message);
    return;
  }
  failures_ = 0;
  if (result.frame.ticket.frame_id <= obsolete_frames_) return;
  last_said_ = now;
  cost_.add(result.frame.ticket);
  if (result.frame.ticket.speculated) shown_is_passing_ = true;
  flow_.sent(result.frame.ticket.frame_id, result.frame.bitstream.size(),
             result.frame.ticket.size_px, now);
  const auto dropped = host_.send(std::move(result.frame));
  for (const std::uint64_t id : dropped) flow_.lost(id);
  if (dropped.empty()) return;
  idr_due_ = true;
  frames_dropped_ += dropped.size();
  stats_.dropped_packets += static_cast<std::uint32_t>(dropped.size());
}

void Session::on_frame_sent(const FrameTicket& ticket, std::size_t bytes) {
  ++frames_sent_;
  bytes_sent_ += bytes;
  ++second_frames_;
  second_bytes_ += bytes;
  if (!ticket.refined) ++(ticket.speculated ? stats_.sub_frames : stats_.key_frames);
}

void Session::say(const ServerMessage& message, TimePoint now) {
  last_said_ = now;
  host_.send(message);
}

void Session::on_tick(TimePoint now) {
  if (state_ == State::awaiting_hello && now - created_ >= policy_.hello_timeout)
    return fail(ErrorCode::bad_message, "no hello within the time limit");
  if (awaited_scene_ && !lost_at_ && state_ != State::closed && state_ != State::opening)
    ask_for_scene(now);
  if (state_ == State::closed || state_ == State::queued) return;
  if (lost_at_) {
    if (now - *lost_at_ >= policy_.resume_grace) state_ = State::closed;
    return;
  }
  if (idr_request_waits_) on(RequestIdr{}, now);
  if (flow_.update(now)) follow_ladder();
  if (policy_.idle_timeout > 0ms) {
    const auto left = last_activity_ + policy_.idle_timeout - now;
    if (left <= 0ms) return fail(ErrorCode::idle_timeout, "nothing has moved for a long time");
    if (!idle_warned_ && left <= policy_.idle_warning) {
      idle_warned_ = true;
      const auto seconds = std::chrono::ceil<std::chrono::seconds>(left).count();
      say(ErrorMessage{ErrorCode::idle_timeout,
                       fmt::format("nothing moves: move the camera to keep this session, which "
                                   "ends in {} s otherwise",
                                   seconds),
                       false},
          now);
    }
  }
  if (now - second_start_ >= 1s) send_statistics(now);
  if (now - last_said_ >= speak_at_least_every) {
    const auto since_epoch = now.time_since_epoch();
    say(Heartbeat{std::chrono::duration_cast<std::chrono::microseconds>(since_epoch).count()}, now);
  }
}

void Session::send_statistics(TimePoint now) {
  const float seconds = std::chrono::duration<float>(now - second_start_).count();
  second_start_ = now;
  if (second_frames_ == 0) return;  // the heartbeat speaks for a still picture
  stats_.fps = static_cast<float>(second_frames_) / seconds;
  stats_.bitrate_kbps = static_cast<float>(second_bytes_) * 8e-3f / seconds;
  stats_.sessions = host_.session_count();
  stats_.target_bitrate_kbps = flow_.bitrate_kbps();
  stats_.target_fps = static_cast<int>(1s / flow_.frame_interval());
  stats_.steps_down = static_cast<std::uint32_t>(flow_.steps_down());
  stats_.queue_delay_us = static_cast<std::uint32_t>(flow_.queue_delay().count());
  stats_.rtt_us = static_cast<std::uint32_t>(flow_.credit().base_rtt().count());
  say(stats_, now);
  stats_ = {};
  second_frames_ = 0;
  second_bytes_ = 0;
}

void Session::follow_ladder() {
  const glm::ivec2 size_px = scaled_size(flow_wish().size_px, flow_.rung().scale);
  if (state_ == State::live && size_px != config_.size_px) request_stream();
}

void Session::drain(std::chrono::milliseconds deadline) {
  if (state_ == State::closed) return;
  host_.send(Drain{static_cast<std::uint32_t>(deadline.count())});
}

void Session::end(std::string_view reason) {
  if (state_ == State::closed) return;
  state_ = State::closed;
  host_.close(CloseCode::going_away, reason);
}

}  // namespace catgs

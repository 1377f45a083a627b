#include "server/session/session.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "render_core/base/build_info.h"
#include "server/net/wire.h"
#include "server/session/frame_size.h"
#include "server/session/same_view.h"

namespace catgs {
namespace {

using namespace std::chrono_literals;

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

glm::ivec2 still_size_within(const SessionPolicy& policy, const Settings& settings,
                             glm::ivec2 viewport_px) {
  const glm::ivec2 moving_px = wish_within(policy, settings, viewport_px).size_px;
  if (settings.fixed_quality || settings.still_size_px.x == 0) return moving_px;
  const glm::ivec2 still_px = frame_size(settings.still_size_px, policy.max_pixels);
  return still_px.x * still_px.y > moving_px.x * moving_px.y ? still_px : moving_px;
}

Session::Session(std::string id, const SessionPolicy& policy, SessionHost& host, TimePoint now)
    : id_(std::move(id)),
      policy_(policy),
      host_(host),
      created_(now),
      rest_(policy.still_after),
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
  admission_ = std::get<Admission>(std::move(answer));
  enter_scene(admission_.scene);
  viewport_px_ = hello.viewport_px;
  settings_ = hello.settings;
  state_ = State::opening;
  encode_as_wished();
  go_on_from(hello, now);
  request_stream();
}

/// Where the client was, and where a tour was leading it.
void Session::go_on_from(const Hello& hello, TimePoint now) {
  if (!hello.resume_path.samples.empty()) on(hello.resume_path, now);
  if (hello.resume_pose) on(*hello.resume_pose, now);
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
  idr_.begin();
  const bool same_stream =
      admission.scene == admission_.scene && admission.encoder.kind == admission_.encoder.kind;
  admission_.encoder = std::move(admission.encoder);
  if (admission.scene != admission_.scene) enter_scene(std::move(admission.scene));
  welcome_due_ = true;
  viewport_px_ = hello.viewport_px;
  settings_ = hello.settings;
  encode_as_wished();
  if (hello.resume_pose) track_.begin_anew();  // as the numbers of a page that was loaded anew
  go_on_from(hello, now);
  if (!same_stream) return request_stream();
  describe_encoding();
  if (state_ == State::live && !opening_stream_) say_config(now);
}

void Session::on(const PoseSample& sample, TimePoint now) {
  const auto before = track_.newest();
  // What is drawn now is seen as much later as pictures have come after their poses lately.
  if (!track_.add(sample, flow_.pose_to_photon())) {
    if (sample.at_rest && sample.pose_id == before->pose_id) rest_.said(now);
    return;
  }
  pose_received_ = now;
  pace_.pose_arrived(flow_.frame_interval(), now);
  if (!before || !same_view(*before, sample, admission_.scene->facts.near_z)) {
    note_activity(now);
    rest_.moved(now);
  }
  if (sample.at_rest) rest_.said(now);  // the first one with this id gave way to it
}

void Session::on(const PosePath& path, TimePoint now) {
  note_activity(now);
  track_.follow(path);
}

void Session::on(const Pick& pick, TimePoint now) {
  note_activity(now);
  if (picks_.take(now)) say(admission_.scene->seen_along(pick), now);
}

void Session::on(const Ack& ack, TimePoint now) {
  const bool held_back = !flow_.may_send();
  if (!flow_.acknowledged(ack, now)) return;
  if (ack.dropped) ++frames_dropped_;
  if (held_back && flow_.may_send()) pace_.credit_returned(now);
}

void Session::on(const Settings& settings, TimePoint now) {
  note_activity(now);
  if (settings == settings_) return;
  settings_ = settings;
  settings_wait_ = true;
  follow_settings(now);
}

void Session::follow_settings(TimePoint now) {
  if (!settings_wait_ || now - settings_followed_ < policy_.settings_gap) return;
  settings_wait_ = false;
  settings_followed_ = now;
  stills_fail_ = false;
  encode_as_wished();
}

void Session::encode_as_wished() {
  FlowWish wish = wish_within(policy_, settings_, viewport_px_);
  wish.size_px = scaled_size(wish.size_px, std::sqrt(admission_.pixel_share));
  flow_.set_wish(wish);
  encoding_.size_px = scaled_size(wish.size_px, flow_.rung().scale);
  encoding_.fps = wish.fps;
  encoding_.bitrate_kbps = wish.bitrate_kbps;
  apply(admission_.effort, encoding_);
  still_size_px_ = still_size_within(policy_, settings_, viewport_px_);
}

void Session::on(const RequestIdr&, TimePoint) { idr_.request(); }

void Session::on(const Pause& pause, TimePoint now) {
  note_activity(now);
  if (paused_ && !pause.paused) {
    // A hidden page presents nothing, so its frames in flight were never acknowledged.
    flow_.forget_in_flight();
    idr_.missed();
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
  describe_encoding();
  host_.open_stream({admission_.scene->renderer, admission_.encoder.kind, encoding_});
}

void Session::describe_encoding() {
  config_.size_px = encoding_.size_px;
  config_.fps = encoding_.fps;
  config_.bitrate_kbps = encoding_.bitrate_kbps;
}

void Session::on_stream_opened(const StreamOpened& opened, TimePoint now) {
  opening_stream_ = false;
  if (state_ == State::closed) return;
  if (opened.fault == Fault::encoder_unavailable) {
    if (auto other = host_.other_encoder(opened.fault)) {
      admission_.encoder = *std::move(other);
      return request_stream();
    }
  }
  if (!opened.ok)
    return fail(ErrorCode::internal, "the stream cannot be opened: " + opened.message);
  if (stream_outdated_) return request_stream();
  config_.codec = opened.codec;
  config_.codec_string = opened.codec_string;
  config_.encoder = admission_.encoder.text;
  device_ = opened.device;
  state_ = State::live;
  note_activity(now);
  encoded_as_.reset();
  stills_fail_ = false;
  idr_.begin();
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
  follow_settings(now);
  if (flow_.update(now)) encode_as_wished();
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

void Session::use_effort(const EncoderEffort& effort) {
  admission_.effort = effort;
  apply(effort, encoding_);
}

void Session::use_pixel_share(double share) {
  admission_.pixel_share = share;
  encode_as_wished();
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

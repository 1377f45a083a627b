#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "render_core/scene/analysis/surface_points.h"
#include "server/net/connection.h"
#include "server/net/messages.h"
#include "server/schedule/frame_executor.h"
#include "server/schedule/next_frame_cost.h"
#include "server/schedule/scheduler.h"
#include "server/session/admission_queue.h"
#include "server/session/camera_track.h"
#include "server/session/encoder_allocator.h"
#include "server/session/encoder_effort.h"
#include "server/session/flow_control.h"
#include "server/session/frame_pace.h"
#include "server/session/idr_policy.h"
#include "server/session/rate_limit.h"
#include "server/session/rest.h"
#include "server/session/scene_source.h"
#include "server/tours.h"

namespace catgs {

/// A scene as sessions see it: one copy, shared by all.
struct SceneEntry {
  SceneFacts facts;
  std::shared_ptr<Renderer> renderer;
  std::string renderer_text;  // description and reason, for people
  std::shared_ptr<const SurfacePoints> surface{};
  std::filesystem::path sidecar{};  // where it is or would be; empty: nowhere
  ToursAnswers tours{};
  std::shared_ptr<const std::string> poster{};  // a JPEG file; null: none

  [[nodiscard]] Picked seen_along(const Pick& ray) const {
    return {ray.id, surface ? surface->distance_along(ray.origin, ray.direction) : std::nullopt};
  }
};

/// What a session got at its admission.
struct Admission {
  std::shared_ptr<const SceneEntry> scene;
  EncoderChoice encoder;
  EncoderEffort effort{};    // of libx264
  double pixel_share = 1.0;  // of the wish for a moving camera; the server has no room for more
};

/// What a hello comes to.
using AdmissionAnswer = std::variant<Admission, QueuePlace, SceneAwaited, ErrorMessage>;

/// Ticks come every 250 ms, and a client hears something at least once a second.
inline constexpr std::chrono::milliseconds speak_at_least_every{750};

struct SessionPolicy {
  std::chrono::milliseconds hello_timeout{5000};
  std::chrono::milliseconds idle_timeout{15 * 60 * 1000};  // 0: never
  std::chrono::milliseconds idle_warning{30'000};          // before the timeout
  std::chrono::milliseconds resume_grace{30'000};  // a lost client may come back for so long
  std::chrono::milliseconds longest_wait{10 * 60 * 1000};  // for a place
  /// A client that has waited for so long is not overtaken any more by those who ask for less.
  std::chrono::milliseconds overtaken_at_most{30'000};
  int default_fps = 60;
  int max_fps = 120;
  int default_bitrate_kbps = 8000;
  int max_bitrate_kbps = 100'000;
  int max_pixels = 3840 * 2160;                // larger wishes are scaled down
  std::chrono::milliseconds still_after{100};  // without another view, at least: see Rest
  int refine_frames = 60;  // that sharpen a still picture at most, where the link is slow
  /// Between encoders that a client's settings ask for; the newest ones count.
  std::chrono::milliseconds settings_gap{250};
  std::chrono::milliseconds select_gap{250};  // between scenes that it asks for; likewise
};

/// What a client's wishes come to within the server's limits, while the camera moves.
FlowWish wish_within(const SessionPolicy& policy, const Settings& settings, glm::ivec2 viewport_px);
/// The same for a picture that stays.
glm::ivec2 still_size_within(const SessionPolicy& policy, const Settings& settings,
                             glm::ivec2 viewport_px);

/// What a session needs from the server around it. Its owner implements it; tests fake it.
class SessionHost {
 public:
  virtual ~SessionHost() = default;
  virtual AdmissionAnswer admit(const Hello& hello) = 0;
  virtual SceneAnswer find_scene(const std::string& scene_id) = 0;
  virtual std::vector<std::string> scene_ids() = 0;
  virtual std::uint32_t session_count() = 0;
  /// Fills in the welcome's tokens.
  virtual void sign(Welcome& welcome) = 0;
  virtual void send(const ServerMessage& message) = 0;
  /// Returns the ids of the frames that were dropped for it.
  virtual std::vector<std::uint64_t> send(OutgoingFrame frame) = 0;
  virtual void close(CloseCode code, std::string_view reason) = 0;
  /// Answered by Session::on_stream_opened().
  virtual void open_stream(StreamSettings settings) = 0;
  /// The encoder of the admission cannot be opened, or failed: another one, or nothing.
  virtual std::optional<EncoderChoice> other_encoder(Fault why) = 0;
};

/// Frame of a session that its owner hands to an executor, with a stream of its own.
struct FrameOrder {
  FrameTicket ticket;
  FrameRequest request;
  EncoderSettings encoding;
  int bitrate_kbps = min_bitrate_kbps;
  int real_fps = 1;
  bool force_idr = false;
};

/// One client's life: hello -> admission, perhaps after a wait -> welcome -> poses, frames, acks ->
/// bye. A client that was lost is waited for with everything kept, but nothing rendered. It knows
/// no socket, no thread and no clock: events come with their time, effects leave through the host.
/// Rendering is on demand: a frame is due when the newest pose shows another picture than the last
/// frame and the client has credit. Not thread-safe.
class Session {
 public:
  enum class State { awaiting_hello, queued, opening, live, closed };

  Session(std::string id, const SessionPolicy& policy, SessionHost& host, TimePoint now);

  void on_message(const ClientMessage& message, TimePoint now);
  /// A message that could not be parsed: says why and closes.
  void on_bad_message(std::string_view what);
  void on_stream_opened(const StreamOpened& opened, TimePoint now);
  void on_frame(FrameResult result, TimePoint now);
  void on_link(const LinkState& link, TimePoint now) { flow_.observed(link, now); }
  /// A frame has left through the socket: only now it counts as sent.
  void on_frame_sent(const FrameTicket& ticket, std::size_t bytes);
  /// At least four times a second: timeouts, statistics, heartbeat.
  void on_tick(TimePoint now);
  /// Tells the client why and closes; for reasons outside the session.
  void fail(ErrorCode code, std::string_view message);
  /// Asks the client to go on elsewhere; frames go on until it does.
  void drain(std::chrono::milliseconds deadline);
  /// One of the next frames shall be an IDR.
  void want_idr() { idr_.request(); }
  /// The encoder goes on with this one, from an IDR on.
  void use_effort(const EncoderEffort& effort);
  /// Pictures of a moving camera have this share of the wished pixels from the next one on.
  void use_pixel_share(double share);
  [[nodiscard]] double pixel_share() const { return admission_.pixel_share; }
  /// What a client is told first. Only while live.
  [[nodiscard]] Welcome welcome();
  /// Closes the connection of a server that goes away.
  void end(std::string_view reason);
  /// While queued: it moved up, or a second has passed.
  void on_queue_moved(const QueuePlace& place, TimePoint now) {
    if (state_ == State::queued) say(place, now);
  }
  /// While queued for a place: there may be one now.
  void ask_again(TimePoint now);
  /// While queued: what the client asked for, with the settings that it sent since.
  [[nodiscard]] const Hello& waiting_hello() const { return waiting_hello_; }
  void on_disconnected() { state_ = State::closed; }
  /// The connection is gone without a farewell. After the grace the session closes.
  void on_lost(TimePoint now);
  /// The client is back, perhaps with other wishes. It gets a welcome, then an IDR. Only while
  /// resumable().
  void on_resumed(const Hello& hello, Admission admission, TimePoint now);
  /// It waits for its scene and not for a place.
  [[nodiscard]] bool awaits_scene() const { return awaited_scene_.has_value(); }
  [[nodiscard]] bool resumable() const { return state_ == State::opening || state_ == State::live; }

  /// When the next frame may start; none: there is nothing to show or no credit.
  [[nodiscard]] std::optional<FrameCandidate> next_frame() const;
  /// Starts the frame that next_frame() announced; on_frame() ends it.
  FrameOrder start_frame(TimePoint now);

  [[nodiscard]] State state() const { return state_; }
  [[nodiscard]] const std::string& id() const { return id_; }
  /// Between its frames, as far as they really follow each other.
  [[nodiscard]] std::chrono::microseconds frame_interval() const {
    return std::max(flow_.frame_interval(), pace_.real_interval());
  }
  [[nodiscard]] const FlowControl& flow() const { return flow_; }
  /// What the client has been told last.
  [[nodiscard]] const StreamConfig& config() const { return config_; }
  /// Of pictures of a moving camera.
  [[nodiscard]] glm::ivec2 moving_size_px() const { return encoding_.size_px; }
  [[nodiscard]] int fps() const { return encoding_.fps; }
  [[nodiscard]] const SceneEntry* scene() const { return admission_.scene.get(); }
  [[nodiscard]] std::optional<int> device() const { return device_; }
  [[nodiscard]] std::uint64_t frames_sent() const { return frames_sent_; }
  [[nodiscard]] std::uint64_t frames_dropped() const { return frames_dropped_; }
  [[nodiscard]] std::uint64_t bytes_sent() const { return bytes_sent_; }
  [[nodiscard]] bool paused() const { return paused_; }
  [[nodiscard]] bool lost() const { return lost_at_.has_value(); }
  /// Pictures can be seen, and for a while the visitor has done nothing: longer than Rest asks for,
  /// which decides about sharp pictures.
  [[nodiscard]] bool rests(TimePoint now) const {
    constexpr std::chrono::milliseconds a_while{500};
    return state_ == State::live && now - last_activity_ >= a_while;
  }
  [[nodiscard]] const EncoderEffort& effort() const { return admission_.effort; }
  [[nodiscard]] EncoderKind encoder_kind() const { return admission_.encoder.kind; }
  /// Its stream is open, and somebody looks.
  [[nodiscard]] bool streams() const {
    return state_ == State::live && !lost_at_ && !paused_ && !opening_stream_;
  }

 private:
  void on(const UnknownMessage&, TimePoint) {}
  void on(const Hello& hello, TimePoint now);
  void on(const PoseSample& sample, TimePoint now);
  void on(const PosePath& path, TimePoint now);
  void on(const Ack& ack, TimePoint now);
  void on(const Settings& settings, TimePoint now);
  void on(const SelectScene& select, TimePoint now);
  void on(const RequestIdr&, TimePoint now);
  void on(const Pause& pause, TimePoint now);
  void on(const Bye&, TimePoint);
  void on(const Pick& pick, TimePoint now);

  void greet(const Hello& hello, TimePoint now);
  void go_on_from(const Hello& hello, TimePoint now);
  void on_queued(const ClientMessage& message);
  /// A scene is being loaded: notes which one, and tells the client how long that may take.
  void await_scene(const std::string& scene_id, const SceneAwaited& awaited, TimePoint now);
  void ask_for_scene(TimePoint now);
  void select(const std::string& scene_id, TimePoint now);
  void enter_scene(std::shared_ptr<const SceneEntry> scene);
  /// Somebody is there: the time to release starts anew, and so does its warning.
  void note_activity(TimePoint now);
  void say(const ServerMessage& message, TimePoint now);
  void say_config(TimePoint now);
  void request_stream();
  void describe_encoding();
  void send_statistics(TimePoint now);
  [[nodiscard]] bool view_has_changed() const;
  /// The client's wishes and the rung of the ladder hold for the next frame.
  void encode_as_wished();
  /// Not more often than the policy says, so that settings that alternate open few encoders.
  void follow_settings(TimePoint now);
  [[nodiscard]] glm::ivec2 still_size_px() const {
    return stills_fail_ ? encoding_.size_px : still_size_px_;
  }
  /// The picture on show is not the one that may stay.
  [[nodiscard]] bool wants_still() const {
    return shown_is_passing_ || !encoded_as_ || encoded_as_->size_px != still_size_px();
  }
  [[nodiscard]] EncoderSettings encoding_at(bool rest) const;
  /// How large it may become, and how soon another may follow.
  void limit(FrameOrder& order, TimePoint now);
  void on_failed_frame(const FrameResult& result);
  void tell_config(const FrameResult& result, TimePoint now);

  const std::string id_;
  const SessionPolicy& policy_;
  SessionHost& host_;
  State state_ = State::awaiting_hello;
  const TimePoint created_;

  Hello waiting_hello_;  // while queued
  /// Not in memory yet: that of the waiting hello, or the one that a live client has selected, too
  /// soon after another one perhaps. Each tick asks for it.
  std::optional<std::string> awaited_scene_;
  TimePoint told_of_scene_{};
  TimePoint selected_{};
  Admission admission_;
  glm::ivec2 viewport_px_{0};
  Settings settings_;
  StreamConfig config_;
  EncoderSettings encoding_;                   // while the camera moves
  std::optional<EncoderSettings> encoded_as_;  // the last frame; none: of another stream
  EncoderSettings described_;    // while the camera moves, when the last frame started
  glm::ivec2 still_size_px_{0};  // when it rests
  bool stills_fail_ = false;     // in that size: as in motion
  bool settings_wait_ = false;
  TimePoint settings_followed_{};
  std::optional<int> device_;  // that its stream renders on, where a device has a number
  bool opening_stream_ = false;
  bool stream_outdated_ = false;  // another one was wanted while it was busy
  bool welcome_due_ = false;      // the scene is new to the client

  FlowControl flow_;
  NextFrameCost cost_;
  FramePace pace_;
  IdrPolicy idr_;
  CameraTrack track_;
  TimePoint pose_received_{};
  Rest rest_;
  TimePoint next_refinement_{};
  std::optional<PoseSample> shown_;  // pose of the last picture rendered
  bool shown_is_passing_ = false;    // it may not stay: a sub-frame, or of a forecast
  int refinements_left_ = 0;
  bool rendering_ = false;
  std::optional<TimePoint> lost_at_;
  std::uint64_t obsolete_frames_ = 0;  // up to this id they were made for a lost connection
  bool paused_ = false;
  int failures_ = 0;  // of rendering or encoding, in a row
  std::uint64_t frames_started_ = 0;

  TimePoint last_said_{};
  TimePoint last_activity_;
  RateLimit picks_;
  bool idle_warned_ = false;

  // Since the last Stats message.
  TimePoint second_start_{};
  std::uint32_t second_frames_ = 0;
  std::uint64_t second_bytes_ = 0;
  Stats stats_;

  std::uint64_t frames_sent_ = 0;
  std::uint64_t frames_dropped_ = 0;
  std::uint64_t bytes_sent_ = 0;
};

}  // namespace catgs

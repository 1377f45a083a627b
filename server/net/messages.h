#pragma once

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "render_core/math/camera.h"
#include "render_core/math/stereo.h"
#include "render_core/scene/scene_about.h"
#include "render_core/scene/splat_model.h"
#include "server/base/clock.h"
#include "server/encode/encoder.h"

namespace catgs {

// The wire contract (proto/catgs.proto) as plain structs for the rest of the server.
// parse_client_message() validates client messages: numbers are finite and within the contract's
// limits, and quaternions have unit length.

struct PoseSample {
  std::uint64_t pose_id = 0;
  std::int64_t client_time_us = 0;  // client's clock
  Pose world_from_camera;
  float fov_y_rad = 0.0f;
  bool at_rest = false;      // nothing moves the camera
  float view_height = 0.0f;  // world units, of an orthographic view; 0: perspective
};

struct PosePath {
  std::vector<PoseSample> samples;  // in time order
};

struct Settings {
  glm::ivec2 size_px{0};        // 0: the viewport's
  glm::ivec2 still_size_px{0};  // when the camera rests; 0: size_px
  int max_fps = 0;              // 0: the server's default
  int max_bitrate_kbps = 0;
  bool fixed_quality = false;
  bool depths = false;             // frames bring a depth grid, where the core makes them
  std::optional<Stereo> stereo{};  // pictures show two eyes, and sizes are those of both

  bool operator==(const Settings&) const = default;
};

/// The visitor's device, as the page sees it.
enum class DeviceKind { unknown, desktop, phone, tablet, headset };
inline constexpr std::size_t device_kinds = 5;
inline constexpr std::array<std::string_view, device_kinds> device_names = {
    "unknown", "desktop", "phone", "tablet", "headset"};

struct Hello {
  std::uint32_t version = 0;
  std::string scene_id;
  glm::ivec2 viewport_px{0};
  std::vector<Codec> decoders;  // best first
  std::string token;
  std::string resume_token;
  std::optional<PoseSample> resume_pose;
  PosePath resume_path;  // empty: no path
  std::string watch_token;
  bool follow = false;  // rather a session of its own than to watch
  DeviceKind device = DeviceKind::unknown;
  Settings settings;
};

struct Ack {
  std::uint64_t frame_id = 0;
  std::int64_t received_us = 0;  // client's clock, as the next two; 0: did not happen
  std::int64_t decoded_us = 0;
  std::int64_t presented_us = 0;
  bool dropped = false;
  std::uint32_t pose_age_us = 0;
};

struct SelectScene {
  std::string scene_id;
};
struct RequestIdr {};
struct Pause {
  bool paused = false;
};
struct Bye {};
struct Pick {
  std::uint32_t id = 0;
  glm::vec3 origin{0.0f};
  glm::vec3 direction{0.0f, 0.0f, 1.0f};  // unit
};
struct Present {
  bool on = false;
  std::string name;
  bool pings = false;         // followers may point at places
  bool tells_places = false;  // the participants hear where all of them are
};
struct Follow {
  std::string watch_token;  // empty: follow nobody
};
/// The visitor has come to a stop of a tour. Both count from 0.
struct Reached {
  std::uint32_t tour = 0, stop = 0;
};
/// The visitor may go to this scene soon.
struct Prepare {
  std::string scene_id;
};
/// A participant of a shared tour points at a place of the scene.
struct Ping {
  glm::vec3 place{0.0f};
};
/// The client wants to know which of these points the scene hides from its camera.
struct Markers {
  std::uint32_t id = 0;
  std::vector<glm::vec3> points;
};
inline constexpr int max_markers = 256;
/// The stop of the scene's tours that a visitor sees. Numbers count from 1; 0: none.
struct Show {
  std::uint32_t tour = 0, stop = 0;
  bool arrived = false;  // the camera is at the stop
  bool operator==(const Show&) const = default;
};
/// A message of a newer wire version. It is ignored, as the contract demands.
struct UnknownMessage {};

using ClientMessage = std::variant<UnknownMessage, Hello, PoseSample, PosePath, Ack, Settings,
                                   SelectScene, RequestIdr, Pause, Bye, Pick, Present, Follow,
                                   Reached, Prepare, Ping, ClipBox, Markers, Show>;

struct SceneFacts {
  std::string scene_id;
  std::string title;
  std::uint64_t gaussians = 0;
  SplatModel model = SplatModel::standard;
  glm::vec3 up{0.0f, -1.0f, 0.0f};
  Pose start_pose;
  glm::vec3 focus{0.0f};
  glm::vec3 limits_min{0.0f};
  glm::vec3 limits_max{0.0f};
  glm::vec3 content_min{0.0f}, content_max{0.0f};  // of nearly all Gaussians; the same: not known
  float near_z = 0.2f;
  float scale = 1.0f;
  glm::dvec3 origin{0.0};       // that all places on the wire are about, see scene_origin.h
  bool up_is_doubtful = false;  // see SceneHints
  bool start_enclosed = false;
  SceneAbout about;
};

struct StreamConfig {
  Codec codec = Codec::h264;
  std::string codec_string;
  glm::ivec2 size_px{0};
  int fps = 0;
  int bitrate_kbps = 0;
  std::string encoder;

  bool operator==(const StreamConfig&) const = default;
};

struct Welcome {
  std::string session_id;
  std::string resume_token;
  SceneFacts scene;
  StreamConfig config;
  std::string renderer;
  std::string server_version;
  std::vector<std::string> scene_ids;
  std::string watch_token;
  bool watching = false;
  bool may_leave = false;
  std::string scene_pass;
};

struct Stats {
  float fps = 0.0f;
  float bitrate_kbps = 0.0f;
  std::uint32_t dropped_packets = 0;
  std::uint32_t sessions = 0;
  int target_bitrate_kbps = 0;
  int target_fps = 0;
  std::uint32_t steps_down = 0;
  std::uint32_t queue_delay_us = 0;
  std::uint32_t rtt_us = 0;
  // The last picture of a scene in pages.
  std::uint32_t gaussians_drawn = 0;
  std::uint32_t nodes_drawn = 0;
  std::uint32_t missing_pages = 0;
  float coarsest_px = 0.0f;
  float detail_px = 0.0f;
  int finest_level = 0;
  int coarsest_level = 0;
  float device_ms = 0.0f;  // mean of a frame
  float frames_per_key = 0.0f;
  std::uint32_t windows_cut = 0;
};

struct Heartbeat {
  std::int64_t server_time_us = 0;
};

inline Heartbeat heartbeat_at(TimePoint now) {
  const auto since_epoch = now.time_since_epoch();
  return {std::chrono::duration_cast<std::chrono::microseconds>(since_epoch).count()};
}

enum class ErrorCode {
  bad_message = 1,
  unauthorized,
  unknown_scene,
  unsupported_version,
  no_common_codec,
  server_full,
  rate_limited,
  render_failed,
  idle_timeout,
  internal,
  session_ended,
  no_leader,
};

/// As the log names it.
constexpr std::string_view name_of(ErrorCode code) {
  constexpr std::string_view names[] = {"",
                                        "bad_message",
                                        "unauthorized",
                                        "unknown_scene",
                                        "unsupported_version",
                                        "no_common_codec",
                                        "server_full",
                                        "rate_limited",
                                        "render_failed",
                                        "idle_timeout",
                                        "internal",
                                        "session_ended",
                                        "no_leader"};
  static_assert(std::size(names) == 1 + static_cast<std::size_t>(ErrorCode::no_leader));
  return names[static_cast<std::size_t>(code)];
}

struct ErrorMessage {
  ErrorCode code = ErrorCode::internal;
  std::string message;
  bool fatal = true;
};

struct Drain {
  std::uint32_t deadline_ms = 0;
};

/// The position of a client that waits for a place or for its scene.
struct QueuePosition {
  int position = 1;                 // 1: next
  std::chrono::seconds estimate{};  // of the whole wait
  bool for_scene = false;           // a place is free, but the scene is still loading
};

/// The answer to a Pick.
struct Picked {
  std::uint32_t id = 0;
  std::optional<float> distance;  // none: nothing was hit
  float spread = 0.0f;            // of the distance
};

/// The markers that something covers, as indices into Markers::points, in order.
struct HiddenMarkers {
  std::uint32_t id = 0;
  std::vector<std::uint32_t> indices;
};

enum class LeadState { leads, away, ended };

struct Lead {
  LeadState state = LeadState::leads;
  std::string name;
  std::size_t participants = 0;      // who watch or follow
  std::optional<PoseSample> camera;  // to followers
  bool may_ping = false;             // followers may
  bool elsewhere = false;            // of ended: the leader is in another scene
  Show shown{};                      // by the leader
  std::string scene_pass{};          // to spectators: in place of the welcome's
};

struct Pinged {
  glm::vec3 place{0.0f};
  bool by_leader = false;
};

/// Where a leader, who is the first, and its followers are.
struct Participants {
  std::vector<glm::vec3> positions;
  bool operator==(const Participants&) const = default;
};
inline constexpr std::size_t most_told_places = 64;

using ServerMessage =
    std::variant<Welcome, QueuePosition, StreamConfig, Stats, Heartbeat, ErrorMessage, Drain,
                 Picked, Lead, Pinged, Participants, HiddenMarkers>;

}  // namespace catgs

#include "server/net/wire.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <stdexcept>
#include <string_view>

#include <fmt/format.h>
#include <glm/geometric.hpp>
#include <google/protobuf/stubs/logging.h>

#include "proto/catgs.pb.h"
#include "server/base/log_event.h"
#include "server/base/scene_id.h"

namespace catgs::wire {
namespace {

/// Protobuf logs a line for each text that is not UTF-8, as often as a stranger likes. By default
/// it would print them outside our log and its bounds.
void log_of_protobuf(google::protobuf::LogLevel level, const char* file, int line,
                     const std::string& message) {
  const bool ends_the_process = level == google::protobuf::LOGLEVEL_FATAL;
  log_event(ends_the_process ? spdlog::level::critical : spdlog::level::debug,
            {.event = "protobuf"}, "protobuf: {}:{}: {}", file, line, message);
}
[[maybe_unused]] auto* const former_log_handler = google::protobuf::SetLogHandler(log_of_protobuf);

/// Beyond this bound, time differences might overflow, and a browser's numbers are no longer exact.
constexpr std::int64_t max_time_us = std::int64_t{1} << 53;
// Bounds the reported age of a picture, because one jump of a clock would spoil every mean.
constexpr std::uint32_t max_pose_age_us = 10'000'000;
constexpr int max_path_samples = 256;
constexpr int max_decoders = 8;
constexpr float max_clip_offset = 1e30f;  // sums with it stay finite
constexpr std::uint32_t most_tours = 32, most_stops = 256;

/// Thrown and caught only in this file, to leave nested message parts.
struct Invalid : std::runtime_error {
  using std::runtime_error::runtime_error;
};

template <typename T>
T checked(std::string_view field, T value, T low, T high) {
  // Written so that a NaN fails.
  if (!(value >= low && value <= high))
    throw Invalid(fmt::format("{}: {} is not in {}…{}", field, value, low, high));
  return value;
}

int checked_or_zero(std::string_view field, std::uint32_t value, std::uint32_t low,
                    std::uint32_t high) {
  return value == 0 ? 0 : static_cast<int>(checked(field, value, low, high));
}

const std::string& checked_length(std::string_view field, const std::string& text,
                                  std::size_t max_bytes) {
  if (text.size() > max_bytes)
    throw Invalid(fmt::format("{}: {} bytes, at most {}", field, text.size(), max_bytes));
  // Control characters would let a client write lines and colours into the log.
  if (std::ranges::any_of(text, [](unsigned char c) { return c < 0x20 || c == 0x7f; }))
    throw Invalid(fmt::format("{}: control characters", field));
  return text;
}

glm::vec3 parse(std::string_view field, const v1::Vec3& v) {
  const auto in_range = [&](char axis, float value) {
    return checked(fmt::format("{}.{}", field, axis), value, -max_coordinate, max_coordinate);
  };
  return {in_range('x', v.x()), in_range('y', v.y()), in_range('z', v.z())};
}

Pose parse(const v1::Pose& message) {
  Pose pose;
  pose.position = parse("pose.position", message.position());
  const auto& q = message.orientation();
  const glm::quat orientation(q.w(), q.x(), q.y(), q.z());
  const float norm = glm::length(orientation);
  checked("pose.orientation norm", norm, 0.9f, 1.1f);
  pose.orientation = orientation / norm;
  return pose;
}

PoseSample parse(const v1::PoseSample& message) {
  PoseSample sample;
  sample.pose_id = message.pose_id();
  sample.client_time_us =
      checked("pose.client_time_us", message.client_time_us(), -max_time_us, max_time_us);
  sample.world_from_camera = parse(message.world_from_camera());
  sample.fov_y_rad = checked("pose.fov_y_rad", message.fov_y_rad(), 0.1f, 2.8f);
  sample.at_rest = message.at_rest();
  return sample;
}

PosePath parse(const v1::PosePath& message) {
  checked("path.samples count", message.samples_size(), 0, max_path_samples);
  PosePath path;
  for (const auto& sample : message.samples()) {
    path.samples.push_back(parse(sample));
    const auto n = path.samples.size();
    if (n > 1 && path.samples[n - 1].client_time_us < path.samples[n - 2].client_time_us)
      throw Invalid("path.samples: not in time order");
  }
  return path;
}

glm::ivec2 checked_size(const std::string& name, std::uint32_t width, std::uint32_t height) {
  const std::string width_field = name + "width_px";
  const std::string height_field = name + "height_px";
  const glm::ivec2 size_px{checked_or_zero(width_field, width, 16, 8192),
                           checked_or_zero(height_field, height, 16, 8192)};
  if ((size_px.x == 0) != (size_px.y == 0))
    throw Invalid(width_field + " and " + height_field + " must be given together");
  return size_px;
}

Settings parse(const v1::Settings& message) {
  Settings settings;
  settings.size_px = checked_size("settings.", message.width_px(), message.height_px());
  settings.still_size_px =
      checked_size("settings.still_", message.still_width_px(), message.still_height_px());
  settings.max_fps = checked_or_zero("settings.max_fps", message.max_fps(), 1, 240);
  settings.max_bitrate_kbps =
      checked_or_zero("settings.max_bitrate_kbps", message.max_bitrate_kbps(), 100, 200'000);
  settings.fixed_quality = message.fixed_quality();
  return settings;
}

Hello parse(const v1::Hello& message) {
  Hello hello;
  hello.version = message.version();
  hello.scene_id = checked_length("hello.scene_id", message.scene_id(), max_scene_id_bytes);
  hello.viewport_px = {
      static_cast<int>(checked("hello.viewport_width_px", message.viewport_width_px(), 16u, 8192u)),
      static_cast<int>(
          checked("hello.viewport_height_px", message.viewport_height_px(), 16u, 8192u))};
  checked("hello.decoders count", message.decoders_size(), 0, max_decoders);
  for (const int codec : message.decoders()) {
    if (codec == v1::CODEC_H264) hello.decoders.push_back(Codec::h264);
    if (codec == v1::CODEC_MJPEG) hello.decoders.push_back(Codec::mjpeg);
  }
  hello.token = checked_length("hello.token", message.token(), 512);
  hello.resume_token = checked_length("hello.resume.token", message.resume().token(), 512);
  if (message.resume().has_pose()) hello.resume_pose = parse(message.resume().pose());
  hello.resume_path = parse(message.resume().path());
  hello.watch_token = checked_length("hello.watch", message.watch(), 512);
  hello.follow = message.follow();
  if (v1::Hello::Device_IsValid(message.device()))
    hello.device = static_cast<DeviceKind>(message.device());
  hello.settings = parse(message.settings());
  return hello;
}

Ack parse(const v1::Ack& message) {
  const auto time = [](std::string_view field, std::int64_t time_us) {
    return checked(field, time_us, std::int64_t{0}, max_time_us);
  };
  Ack ack;
  ack.frame_id = message.frame_id();
  ack.received_us = time("ack.received_us", message.received_us());
  ack.decoded_us = time("ack.decoded_us", message.decoded_us());
  ack.presented_us = time("ack.presented_us", message.presented_us());
  ack.dropped = message.dropped();
  ack.pose_age_us = std::min(message.pose_age_us(), max_pose_age_us);
  return ack;
}

Pick parse(const v1::Pick& message) {
  Pick pick;
  pick.id = message.id();
  pick.origin = parse("pick.origin", message.origin());
  const glm::vec3 direction = parse("pick.direction", message.direction());
  const float length = checked("pick.direction length", glm::length(direction), 1e-6f, 2e9f);
  pick.direction = direction / length;
  return pick;
}

ClipPlane parse(const v1::Clip& message) {
  return {parse("clip.normal", message.normal()),
          checked("clip.offset", message.offset(), -max_clip_offset, max_clip_offset)};
}

ClientMessage parse(const v1::ClientMessage& message) {
  switch (message.body_case()) {
    case v1::ClientMessage::kHello:
      return parse(message.hello());
    case v1::ClientMessage::kPose:
      return parse(message.pose());
    case v1::ClientMessage::kPath:
      return parse(message.path());
    case v1::ClientMessage::kAck:
      return parse(message.ack());
    case v1::ClientMessage::kSettings:
      return parse(message.settings());
    case v1::ClientMessage::kSelectScene:
      return SelectScene{checked_length("select_scene.scene_id", message.select_scene().scene_id(),
                                        max_scene_id_bytes)};
    case v1::ClientMessage::kRequestIdr:
      return RequestIdr{};
    case v1::ClientMessage::kPause:
      return Pause{message.pause().paused()};
    case v1::ClientMessage::kBye:
      return Bye{};
    case v1::ClientMessage::kPick:
      return parse(message.pick());
    case v1::ClientMessage::kPresent:
      return Present{message.present().on(),
                     checked_length("present.name", message.present().name(), 64),
                     message.present().pings(), message.present().tells_places()};
    case v1::ClientMessage::kFollow:
      return Follow{checked_length("follow.watch", message.follow().watch(), 512)};
    case v1::ClientMessage::kReached:
      return Reached{checked("reached.tour", message.reached().tour(), 0u, most_tours - 1),
                     checked("reached.stop", message.reached().stop(), 0u, most_stops - 1)};
    case v1::ClientMessage::kPrepare:
      return Prepare{
          checked_length("prepare.scene_id", message.prepare().scene_id(), max_scene_id_bytes)};
    case v1::ClientMessage::kPing:
      return Ping{parse("ping.place", message.ping().place())};
    case v1::ClientMessage::kClip:
      return parse(message.clip());
    case v1::ClientMessage::BODY_NOT_SET:
      break;
  }
  return UnknownMessage{};
}

v1::Codec to_wire(Codec codec) { return codec == Codec::h264 ? v1::CODEC_H264 : v1::CODEC_MJPEG; }

void fill(const glm::vec3& value, v1::Vec3& out) {
  out.set_x(value.x);
  out.set_y(value.y);
  out.set_z(value.z);
}

void fill(const Pose& pose, v1::Pose& out) {
  fill(pose.position, *out.mutable_position());
  auto& q = *out.mutable_orientation();
  q.set_x(pose.orientation.x);
  q.set_y(pose.orientation.y);
  q.set_z(pose.orientation.z);
  q.set_w(pose.orientation.w);
}

void fill(const StreamConfig& config, v1::StreamConfig& out) {
  out.set_codec(to_wire(config.codec));
  out.set_codec_string(config.codec_string);
  out.set_width_px(static_cast<std::uint32_t>(config.size_px.x));
  out.set_height_px(static_cast<std::uint32_t>(config.size_px.y));
  out.set_fps(static_cast<std::uint32_t>(config.fps));
  out.set_bitrate_kbps(static_cast<std::uint32_t>(config.bitrate_kbps));
  out.set_encoder(config.encoder);
}

void fill(const SceneFacts& scene, v1::SceneFacts& out) {
  out.set_scene_id(scene.scene_id);
  out.set_title(scene.title);
  out.set_gaussians(scene.gaussians);
  fill(scene.up, *out.mutable_up());
  fill(scene.start_pose, *out.mutable_start_pose());
  fill(scene.focus, *out.mutable_focus());
  fill(scene.limits_min, *out.mutable_limits_min());
  fill(scene.limits_max, *out.mutable_limits_max());
  out.set_near_z(scene.near_z);
  out.set_scale(scene.scale);
  out.set_credits(scene.about.credits);
  out.set_licence(scene.about.licence);
  out.set_mode(static_cast<v1::CameraMode>(scene.about.mode));  // of the same order
  out.set_background_rgb(scene.about.background_rgb);
  out.set_metres_per_unit(scene.about.metres_per_unit);
  if (scene.model != SplatModel::standard) out.set_model(std::string(name_of(scene.model)));
}

void fill(const Welcome& welcome, v1::ServerMessage& out) {
  auto& message = *out.mutable_welcome();
  message.set_version(version);
  message.set_session_id(welcome.session_id);
  message.set_resume_token(welcome.resume_token);
  fill(welcome.scene, *message.mutable_scene());
  fill(welcome.config, *message.mutable_config());
  message.set_renderer(welcome.renderer);
  message.set_server_version(welcome.server_version);
  for (const auto& id : welcome.scene_ids) message.add_scene_ids(id);
  message.set_watch_token(welcome.watch_token);
  message.set_watching(welcome.watching);
  message.set_may_leave(welcome.may_leave);
}

void fill(const QueuePlace& place, v1::ServerMessage& out) {
  auto& message = *out.mutable_queue();
  message.set_position(static_cast<std::uint32_t>(place.position));
  message.set_estimate_s(static_cast<std::uint32_t>(place.estimate.count()));
  message.set_for_scene(place.for_scene);
}

void fill(const StreamConfig& config, v1::ServerMessage& out) {
  fill(config, *out.mutable_config());
}

void fill(const Stats& stats, v1::ServerMessage& out) {
  auto& message = *out.mutable_stats();
  message.set_fps(stats.fps);
  message.set_bitrate_kbps(stats.bitrate_kbps);
  message.set_dropped_packets(stats.dropped_packets);
  message.set_sessions(stats.sessions);
  message.set_target_bitrate_kbps(static_cast<std::uint32_t>(stats.target_bitrate_kbps));
  message.set_target_fps(static_cast<std::uint32_t>(stats.target_fps));
  message.set_steps_down(stats.steps_down);
  message.set_queue_delay_us(stats.queue_delay_us);
  message.set_rtt_us(stats.rtt_us);
  message.set_gaussians_drawn(stats.gaussians_drawn);
  message.set_nodes_drawn(stats.nodes_drawn);
  message.set_missing_pages(stats.missing_pages);
  message.set_coarsest_px(stats.coarsest_px);
  message.set_detail_px(stats.detail_px);
  message.set_finest_level(static_cast<std::uint32_t>(stats.finest_level));
  message.set_coarsest_level(static_cast<std::uint32_t>(stats.coarsest_level));
}

void fill(const Heartbeat& heartbeat, v1::ServerMessage& out) {
  out.mutable_heartbeat()->set_server_time_us(heartbeat.server_time_us);
}

void fill(const ErrorMessage& error, v1::ServerMessage& out) {
  auto& message = *out.mutable_error();
  message.set_code(static_cast<v1::Error::Code>(error.code));
  message.set_message(error.message);
  message.set_fatal(error.fatal);
}

void fill(const Drain& drain, v1::ServerMessage& out) {
  out.mutable_drain()->set_deadline_ms(drain.deadline_ms);
}

void fill(const Picked& picked, v1::ServerMessage& out) {
  auto& message = *out.mutable_picked();
  message.set_id(picked.id);
  message.set_hit(picked.distance.has_value());
  message.set_distance(picked.distance.value_or(0.0f));
  message.set_spread(picked.spread);
}

void fill(const Lead& lead, v1::ServerMessage& out) {
  auto& message = *out.mutable_lead();
  message.set_state(static_cast<v1::Lead::State>(lead.state));
  message.set_name(lead.name);
  message.set_company(static_cast<std::uint32_t>(lead.company));
  message.set_may_ping(lead.may_ping);
  if (!lead.camera) return;
  auto& camera = *message.mutable_camera();
  camera.set_pose_id(lead.camera->pose_id);
  camera.set_client_time_us(lead.camera->client_time_us);
  fill(lead.camera->world_from_camera, *camera.mutable_world_from_camera());
  camera.set_fov_y_rad(lead.camera->fov_y_rad);
  camera.set_at_rest(lead.camera->at_rest);
}

void fill(const Pinged& pinged, v1::ServerMessage& out) {
  fill(pinged.place, *out.mutable_pinged()->mutable_place());
  out.mutable_pinged()->set_by_leader(pinged.by_leader);
}

void fill(const Company& company, v1::ServerMessage& out) {
  auto& message = *out.mutable_company();
  for (const glm::vec3& place : company.places) fill(place, *message.add_places());
}

template <typename Body>
constexpr Topic topic_of = Topic::event;
template <>
constexpr Topic topic_of<Welcome> = Topic::session;
template <>
constexpr Topic topic_of<StreamConfig> = Topic::stream;
template <>
constexpr Topic topic_of<QueuePlace> = Topic::place;
template <>
constexpr Topic topic_of<Stats> = Topic::statistics;
template <>
constexpr Topic topic_of<Heartbeat> = Topic::clock;
template <>
constexpr Topic topic_of<Lead> = Topic::leader;
template <>
constexpr Topic topic_of<Pinged> = Topic::ping;
template <>
constexpr Topic topic_of<Company> = Topic::company;

std::uint32_t elapsed_us(TimePoint from, TimePoint to) {
  const auto us = std::chrono::duration_cast<std::chrono::microseconds>(to - from).count();
  return static_cast<std::uint32_t>(std::clamp<std::int64_t>(us, 0, UINT32_MAX));
}

v1::FrameHeader frame_header(const FrameTicket& ticket, TimePoint now) {
  v1::FrameHeader header;
  header.set_frame_id(ticket.frame_id);
  header.set_pose_id(ticket.pose_id);
  header.set_pose_client_time_us(ticket.pose_client_time_us);
  fill(ticket.render_pose, *header.mutable_render_pose());
  header.set_fov_y_rad(ticket.fov_y_rad);
  header.set_codec(to_wire(ticket.codec));
  header.set_idr(ticket.idr);
  header.set_width_px(static_cast<std::uint32_t>(ticket.size_px.x));
  header.set_height_px(static_cast<std::uint32_t>(ticket.size_px.y));
  header.set_wait_us(elapsed_us(ticket.pose_received, ticket.render->start));
  header.set_render_us(elapsed_us(ticket.render->start, ticket.render->end));
  header.set_encode_us(elapsed_us(ticket.render->end, ticket.encode->end));
  header.set_send_wait_us(elapsed_us(ticket.encode->end, now));
  header.set_still(ticket.still);
  return header;
}

}  // namespace

std::variant<ClientMessage, ParseError> parse_client_message(std::span<const std::byte> bytes) {
  if (bytes.size() > max_client_message_bytes)
    return ParseError{
        fmt::format("message: {} bytes, at most {}", bytes.size(), max_client_message_bytes)};
  v1::ClientMessage message;
  if (!message.ParseFromArray(bytes.data(), static_cast<int>(bytes.size())))
    return ParseError{"message: not a ClientMessage of catgs.v1"};
  try {
    return parse(message);
  } catch (const Invalid& error) {
    return ParseError{error.what()};
  }
}

OutgoingMessage serialize(const ServerMessage& message) {
  v1::ServerMessage out;
  const Topic topic = std::visit(
      [&]<typename Body>(const Body& body) {
        fill(body, out);
        return topic_of<Body>;
      },
      message);
  const std::size_t size = out.ByteSizeLong();
  std::vector<std::byte> bytes(1 + size);
  bytes[0] = static_cast<std::byte>(Kind::message);
  out.SerializeWithCachedSizesToArray(reinterpret_cast<std::uint8_t*>(bytes.data() + 1));
  return {topic, std::move(bytes)};
}

void append_frame_header(const FrameTicket& ticket, TimePoint now, std::vector<std::byte>& out) {
  const v1::FrameHeader header = frame_header(ticket, now);
  const std::size_t header_size = header.ByteSizeLong();
  out.push_back(static_cast<std::byte>(Kind::frame));
  for (std::size_t rest = header_size;; rest >>= 7) {
    const bool last = rest < 0x80;
    out.push_back(static_cast<std::byte>((rest & 0x7f) | (last ? 0 : 0x80)));
    if (last) break;
  }
  const std::size_t header_at = out.size();
  out.resize(header_at + header_size);
  header.SerializeWithCachedSizesToArray(reinterpret_cast<std::uint8_t*>(out.data() + header_at));
}

}  // namespace catgs::wire

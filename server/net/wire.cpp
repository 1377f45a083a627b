#include "server/net/wire.h"

#include <algorithm>
#include <chrono>

#include "proto/catgs.pb.h"

namespace catgs::wire {
namespace {

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
  if (scene.content_min != scene.content_max) {
    fill(scene.content_min, *out.mutable_content_min());
    fill(scene.content_max, *out.mutable_content_max());
  }
  out.set_near_z(scene.near_z);
  out.set_scale(scene.scale);
  out.set_credits(scene.about.credits);
  out.set_licence(scene.about.licence);
  out.set_mode(static_cast<v1::CameraMode>(scene.about.mode));  // of the same order
  out.set_background_rgb(scene.about.background_rgb);
  out.set_metres_per_unit(scene.about.metres_per_unit);
  out.set_up_is_doubtful(scene.up_is_doubtful);
  out.set_start_enclosed(scene.start_enclosed);
  if (scene.origin != glm::dvec3(0.0)) {
    auto& origin = *out.mutable_origin();
    origin.set_x(scene.origin.x);
    origin.set_y(scene.origin.y);
    origin.set_z(scene.origin.z);
  }
  for (const SceneWords& words : scene.about.translations) {
    auto& message = *out.add_translations();
    message.set_language(words.language);
    message.set_title(words.title);
    message.set_credits(words.credits);
  }
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
  message.set_scene_pass(welcome.scene_pass);
}

void fill(const QueuePosition& place, v1::ServerMessage& out) {
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
  message.set_device_ms(stats.device_ms);
  message.set_frames_per_key(stats.frames_per_key);
  message.set_windows_cut(stats.windows_cut);
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
  message.set_company(static_cast<std::uint32_t>(lead.participants));
  message.set_may_ping(lead.may_ping);
  message.set_elsewhere(lead.elsewhere);
  message.set_scene_pass(lead.scene_pass);
  if (lead.shown != Show{}) {
    auto& shown = *message.mutable_shown();
    shown.set_tour(lead.shown.tour);
    shown.set_stop(lead.shown.stop);
    shown.set_arrived(lead.shown.arrived);
  }
  if (!lead.camera) return;
  auto& camera = *message.mutable_camera();
  camera.set_pose_id(lead.camera->pose_id);
  camera.set_client_time_us(lead.camera->client_time_us);
  fill(lead.camera->world_from_camera, *camera.mutable_world_from_camera());
  camera.set_fov_y_rad(lead.camera->fov_y_rad);
  camera.set_at_rest(lead.camera->at_rest);
  camera.set_view_height(lead.camera->view_height);
}

void fill(const Pinged& pinged, v1::ServerMessage& out) {
  fill(pinged.place, *out.mutable_pinged()->mutable_place());
  out.mutable_pinged()->set_by_leader(pinged.by_leader);
}

void fill(const Participants& participants, v1::ServerMessage& out) {
  auto& message = *out.mutable_company();
  for (const glm::vec3& place : participants.positions) fill(place, *message.add_places());
}

void fill(const HiddenMarkers& hidden, v1::ServerMessage& out) {
  auto& message = *out.mutable_hidden_markers();
  message.set_id(hidden.id);
  message.mutable_indices()->Add(hidden.indices.begin(), hidden.indices.end());
}

template <typename Body>
constexpr Topic topic_of = Topic::event;
template <>
constexpr Topic topic_of<Welcome> = Topic::session;
template <>
constexpr Topic topic_of<StreamConfig> = Topic::stream;
template <>
constexpr Topic topic_of<QueuePosition> = Topic::place;
template <>
constexpr Topic topic_of<Stats> = Topic::statistics;
template <>
constexpr Topic topic_of<Heartbeat> = Topic::clock;
template <>
constexpr Topic topic_of<Lead> = Topic::leader;
template <>
constexpr Topic topic_of<Pinged> = Topic::ping;
template <>
constexpr Topic topic_of<Participants> = Topic::participants;
template <>
constexpr Topic topic_of<HiddenMarkers> = Topic::markers;

std::uint32_t elapsed_us(TimePoint from, TimePoint to) {
  const auto us = std::chrono::duration_cast<std::chrono::microseconds>(to - from).count();
  return static_cast<std::uint32_t>(std::clamp<std::int64_t>(us, 0, UINT32_MAX));
}

void fill(const PackedDepths& depths, v1::FrameHeader& header) {
  header.set_depth_columns(static_cast<std::uint32_t>(depths.cells.x));
  header.set_depth_rows(static_cast<std::uint32_t>(depths.cells.y));
  header.set_depth_scale(depths.scale);
  header.set_depth_codes(depths.codes.data(), depths.codes.size());
}

void fill(const Eye& eye, v1::Eye& out) {
  out.set_right_of_pose(eye.offset.x);
  out.set_below_pose(eye.offset.y);
  out.set_left(eye.low.x);
  out.set_right(eye.high.x);
  out.set_up(eye.low.y);
  out.set_down(eye.high.y);
}

v1::FrameHeader frame_header(const FrameTicket& ticket, TimePoint now) {
  v1::FrameHeader header;
  header.set_frame_id(ticket.frame_id);
  header.set_pose_id(ticket.pose_id);
  header.set_pose_client_time_us(ticket.pose_client_time_us);
  fill(ticket.render_pose, *header.mutable_render_pose());
  header.set_fov_y_rad(ticket.fov_y_rad);
  header.set_view_height(ticket.view_height);
  header.set_codec(to_wire(ticket.codec));
  header.set_idr(ticket.idr);
  header.set_width_px(static_cast<std::uint32_t>(ticket.size_px.x));
  header.set_height_px(static_cast<std::uint32_t>(ticket.size_px.y));
  header.set_wait_us(elapsed_us(ticket.pose_received, ticket.render->start));
  header.set_render_us(elapsed_us(ticket.render->start, ticket.render->end));
  header.set_encode_us(elapsed_us(ticket.render->end, ticket.encode->end));
  header.set_send_wait_us(elapsed_us(ticket.encode->end, now));
  header.set_still(ticket.still);
  if (ticket.stereo) {
    fill(ticket.stereo->front(), *header.mutable_stereo()->mutable_left());
    fill(ticket.stereo->back(), *header.mutable_stereo()->mutable_right());
  }
  return header;
}

}  // namespace

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

void append_frame_header(const FrameTicket& ticket, const PackedDepths* depths, TimePoint now,
                         std::vector<std::byte>& out) {
  v1::FrameHeader header = frame_header(ticket, now);
  if (depths) fill(*depths, header);
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

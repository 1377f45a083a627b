// Messages from clients: bytes to plain structs, checked.

#include <algorithm>
#include <stdexcept>
#include <string_view>
#include <utility>

#include <fmt/format.h>
#include <glm/geometric.hpp>
#include <google/protobuf/stubs/logging.h>

#include "proto/catgs.pb.h"
#include "server/base/log_event.h"
#include "server/base/scene_id.h"
#include "server/net/wire.h"

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
constexpr float least_length = 1e-6f;     // world units, of boxes and views
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

Pose parse(const v1::Pose& message, const std::string& field = "pose") {
  Pose pose;
  pose.position = parse(field + ".position", message.position());
  const auto& q = message.orientation();
  const glm::quat orientation(q.w(), q.x(), q.y(), q.z());
  const float norm = glm::length(orientation);
  checked(field + ".orientation norm", norm, 0.9f, 1.1f);
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
  if (message.view_height() != 0.0f)
    sample.view_height =
        checked("pose.view_height", message.view_height(), least_length, max_coordinate);
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

Eye parse(const v1::Eye& message, const std::string& field) {
  const auto named = [&](std::string_view part) { return fmt::format("{}.{}", field, part); };
  const auto offset = [&](std::string_view part, float value) {
    return checked(named(part), value, -max_coordinate, max_coordinate);
  };
  const auto tangent = [&](std::string_view part, float value, float low = -max_eye_tangent) {
    return checked(named(part), value, low, max_eye_tangent);
  };
  Eye eye;
  eye.offset = {offset("right_of_pose", message.right_of_pose()),
                offset("below_pose", message.below_pose())};
  eye.low = {tangent("left", message.left()), tangent("up", message.up())};
  eye.high = {tangent("right", message.right(), eye.low.x + 2.0f * least_eye_span),
              tangent("down", message.down(), eye.low.y + 2.0f * least_eye_span)};
  return eye;
}

/// An eye has a whole number of columns.
void check_halves(const Settings& settings) {
  for (const auto& [field, width] :
       {std::pair("settings.width_px", settings.size_px.x),
        std::pair("settings.still_width_px", settings.still_size_px.x)})
    if (width % 2 != 0) throw Invalid(fmt::format("{}: {} is odd, for two eyes", field, width));
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
  settings.depths = message.depths();
  if (message.has_stereo()) {
    settings.stereo = Stereo{parse(message.stereo().left(), "settings.stereo.left"),
                             parse(message.stereo().right(), "settings.stereo.right")};
    check_halves(settings);
  }
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

ClipBox parse(const v1::Clip& message) {
  if (message.has_box()) {
    const Pose pose = parse(message.box().world_from_box(), "clip.box");
    const auto half = [](std::string_view field, float extent) {
      return checked(field, extent, least_length, max_coordinate);
    };
    const auto& extent = message.box().half_extent();
    return oriented_box(
        pose.position, pose.orientation,
        {half("clip.box.half_extent.x", extent.x()), half("clip.box.half_extent.y", extent.y()),
         half("clip.box.half_extent.z", extent.z())});
  }
  const glm::vec3 normal = parse("clip.normal", message.normal());
  const float offset = checked("clip.offset", message.offset(), -max_clip_offset, max_clip_offset);
  return normal == glm::vec3(0.0f) ? ClipBox{} : clip_plane(normal, offset);
}

Markers parse(const v1::Markers& message) {
  checked("markers.points count", message.points_size(), 0, max_markers);
  Markers markers{message.id(), {}};
  for (const auto& point : message.points())
    markers.points.push_back(parse("markers.points", point));
  return markers;
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
    case v1::ClientMessage::kMarkers:
      return parse(message.markers());
    case v1::ClientMessage::kShow:
      return Show{checked("show.tour", message.show().tour(), 0u, most_tours),
                  checked("show.stop", message.show().stop(), 0u, most_stops),
                  message.show().arrived()};
    case v1::ClientMessage::BODY_NOT_SET:
      break;
  }
  return UnknownMessage{};
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

}  // namespace catgs::wire

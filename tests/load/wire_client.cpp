#include "tests/load/wire_client.h"

namespace catgs::load {
namespace {

constexpr std::byte kind_message{1};
constexpr std::byte kind_frame{2};
constexpr std::uint32_t max_header_bytes = 32 * 1024;  // the depths of 128x128 cells, too

/// Base-128 varint of up to 32 bits; false when it does not end within `bytes`.
bool take_varint(std::span<const std::byte>& bytes, std::uint32_t& value) {
  std::uint64_t sum = 0;
  for (std::size_t i = 0; i < bytes.size() && i < 5; ++i) {
    const auto byte = std::to_integer<std::uint64_t>(bytes[i]);
    sum |= (byte & 0x7f) << (7 * i);
    if ((byte & 0x80) != 0) continue;
    if (sum > UINT32_MAX) return false;
    value = static_cast<std::uint32_t>(sum);
    bytes = bytes.subspan(i + 1);
    return true;
  }
  return false;
}

}  // namespace

std::variant<v1::ServerMessage, FrameMessage, WireError> parse_server_message(
    std::span<const std::byte> bytes) {
  if (bytes.empty()) return WireError{"an empty message"};
  const std::byte kind = bytes.front();
  bytes = bytes.subspan(1);
  if (kind == kind_message) {
    v1::ServerMessage message;
    if (!message.ParseFromArray(bytes.data(), static_cast<int>(bytes.size())))
      return WireError{"a ServerMessage that does not parse"};
    return message;
  }
  if (kind != kind_frame)
    return WireError{"kind " + std::to_string(std::to_integer<int>(kind)) + ", neither 1 nor 2"};
  std::uint32_t length = 0;
  if (!take_varint(bytes, length) || length > max_header_bytes || length > bytes.size())
    return WireError{"a frame whose header length does not fit"};
  FrameMessage frame;
  if (!frame.header.ParseFromArray(bytes.data(), static_cast<int>(length)))
    return WireError{"a FrameHeader that does not parse"};
  frame.bitstream = bytes.subspan(length);
  if (frame.bitstream.empty()) return WireError{"a frame without a bitstream"};
  return frame;
}

v1::Pose to_wire(const Pose& world_from_camera) {
  v1::Pose pose;
  pose.mutable_position()->set_x(world_from_camera.position.x);
  pose.mutable_position()->set_y(world_from_camera.position.y);
  pose.mutable_position()->set_z(world_from_camera.position.z);
  pose.mutable_orientation()->set_x(world_from_camera.orientation.x);
  pose.mutable_orientation()->set_y(world_from_camera.orientation.y);
  pose.mutable_orientation()->set_z(world_from_camera.orientation.z);
  pose.mutable_orientation()->set_w(world_from_camera.orientation.w);
  return pose;
}

glm::vec3 from_wire(const v1::Vec3& v) { return {v.x(), v.y(), v.z()}; }

Pose from_wire(const v1::Pose& world_from_camera) {
  const v1::Quaternion& q = world_from_camera.orientation();
  return {from_wire(world_from_camera.position()), glm::quat(q.w(), q.x(), q.y(), q.z())};
}

v1::Stereo to_wire(const Stereo& eyes) {
  const auto fill = [](const catgs::Eye& eye, v1::Eye& out) {
    out.set_right_of_pose(eye.offset.x);
    out.set_below_pose(eye.offset.y);
    out.set_left(eye.low.x);
    out.set_right(eye.high.x);
    out.set_up(eye.low.y);
    out.set_down(eye.high.y);
  };
  v1::Stereo stereo;
  fill(eyes.front(), *stereo.mutable_left());
  fill(eyes.back(), *stereo.mutable_right());
  return stereo;
}

std::optional<Stereo> stereo_of(const v1::FrameHeader& header) {
  if (!header.has_stereo()) return {};
  const auto eye = [](const v1::Eye& e) {
    return catgs::Eye{
        {e.right_of_pose(), e.below_pose()}, {e.left(), e.up()}, {e.right(), e.down()}};
  };
  return Stereo{eye(header.stereo().left()), eye(header.stereo().right())};
}

}  // namespace catgs::load

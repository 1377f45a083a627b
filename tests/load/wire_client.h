#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <variant>

#include "proto/catgs.pb.h"
#include "render_core/math/camera.h"
#include "render_core/math/stereo.h"

namespace catgs::load {

// The client's end of subprotocol "catgs.v1" (proto/README.md).

inline constexpr std::uint32_t wire_version = 1;
inline constexpr std::size_t max_server_message_bytes = 16u << 20;

struct FrameMessage {
  v1::FrameHeader header;
  std::span<const std::byte> bitstream;  // inside the parsed bytes
};

/// A fault of a message from the server.
struct WireError {
  std::string what;
};

std::variant<v1::ServerMessage, FrameMessage, WireError> parse_server_message(
    std::span<const std::byte> bytes);

v1::Pose to_wire(const Pose& world_from_camera);
glm::vec3 from_wire(const v1::Vec3& v);
Pose from_wire(const v1::Pose& world_from_camera);
v1::Stereo to_wire(const Stereo& eyes);
/// The eyes that a frame shows; nothing: one.
std::optional<Stereo> stereo_of(const v1::FrameHeader& header);

}  // namespace catgs::load

#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "server/net/messages.h"
#include "server/pipeline/frame_ticket.h"

namespace catgs::wire {

// Converts between bytes of subprotocol "catgs.v1" (proto/README.md) and plain structs.

inline constexpr std::uint32_t version = 1;
inline constexpr std::size_t max_client_message_bytes = 64 * 1024;

/// Byte 0 of every message from the server.
enum class Kind : std::uint8_t { message = 1, frame = 2 };

/// Describes a bad message, for people: "pose.fov_y_rad: 3.5 is not in 0.1…2.8".
struct ParseError {
  std::string what;
};

/// Parses and validates one message of at most max_client_message_bytes. Never throws on content.
std::variant<ClientMessage, ParseError> parse_client_message(std::span<const std::byte> bytes);

/// Serializes a message, kind byte included, for the socket.
OutgoingMessage serialize(const ServerMessage& message);

/// Appends the bytes before a frame's bitstream: kind byte, varint, FrameHeader. `now` is the time
/// at which the packet is handed to the socket. `depths`: null: none.
void append_frame_header(const FrameTicket& ticket, const PackedDepths* depths, TimePoint now,
                         std::vector<std::byte>& out);

}  // namespace catgs::wire

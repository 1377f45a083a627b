#include "tests/load/pose_tap.h"

#include <algorithm>
#include <cctype>
#include <string_view>

namespace catgs::load {
namespace {

constexpr std::size_t max_head_bytes = 64 * 1024;
constexpr std::uint64_t max_message_bytes = 64 * 1024;  // of catgs.v1, client to server

std::uint64_t big_endian(std::span<const std::byte> bytes) {
  std::uint64_t value = 0;
  for (const std::byte byte : bytes) value = value << 8 | std::to_integer<std::uint64_t>(byte);
  return value;
}

}  // namespace

void PoseTap::read(std::span<const std::byte> bytes) {
  if (state_ == State::deaf) return;
  buffer_.insert(buffer_.end(), bytes.begin(), bytes.end());
  while (state_ == State::head ? take_head() : state_ == State::frames && take_frame()) {
  }
  if (state_ == State::deaf) buffer_.clear();
}

bool PoseTap::take_head() {
  const std::string_view text(reinterpret_cast<const char*>(buffer_.data()), buffer_.size());
  constexpr std::string_view end_mark = "\r\n\r\n";
  const std::size_t end = text.find(end_mark);
  if (end == std::string_view::npos) {
    if (text.size() > max_head_bytes) state_ = State::deaf;
    return false;
  }
  std::string head(text.substr(0, end));
  std::ranges::transform(head, head.begin(), [](unsigned char c) { return std::tolower(c); });
  if (head.find("\r\nupgrade: websocket") != std::string::npos) state_ = State::frames;
  // A request for a file has no body: the next one may follow on the same connection.
  buffer_.erase(buffer_.begin(),
                buffer_.begin() + static_cast<std::ptrdiff_t>(end + end_mark.size()));
  return true;
}

bool PoseTap::take_frame() {
  const std::span<const std::byte> bytes(buffer_);
  if (bytes.size() < 2) return false;
  const bool final = (bytes[0] & std::byte{0x80}) != std::byte{0};
  const auto opcode = std::to_integer<int>(bytes[0] & std::byte{0x0f});
  const bool masked = (bytes[1] & std::byte{0x80}) != std::byte{0};
  std::uint64_t length = std::to_integer<std::uint64_t>(bytes[1] & std::byte{0x7f});
  const std::size_t length_bytes = length == 126 ? 2 : length == 127 ? 8 : 0;
  const std::size_t mask_at = 2 + length_bytes;
  if (bytes.size() < mask_at + 4) return false;
  if (length_bytes > 0) length = big_endian(bytes.subspan(2, length_bytes));
  if (!masked || length > max_message_bytes || message_.size() > max_message_bytes) {
    state_ = State::deaf;  // no client of this protocol
    return false;
  }
  const std::size_t payload_at = mask_at + 4;
  if (bytes.size() < payload_at + length) return false;
  constexpr int continuation = 0, binary = 2;
  if (opcode == continuation || opcode == binary) {
    for (std::size_t i = 0; i < length; ++i)
      message_.push_back(bytes[payload_at + i] ^ bytes[mask_at + i % 4]);
    if (final) {
      v1::ClientMessage message;
      if (message.ParseFromArray(message_.data(), static_cast<int>(message_.size())) &&
          message.has_pose()) {
        on_pose_(message.pose());
      }
      message_.clear();
    }
  }
  buffer_.erase(buffer_.begin(),
                buffer_.begin() + static_cast<std::ptrdiff_t>(payload_at + length));
  return true;
}

}  // namespace catgs::load

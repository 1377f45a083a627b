#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <vector>

#include "server/pipeline/frame_ticket.h"

namespace catgs {

/// The bounded queue of messages and frames for one socket, in order. It is bounded in number and
/// bytes:
/// - frames: overflow drops every waiting frame and refuses new ones up to the next IDR. A decoder
///   cannot use a P-frame without its predecessor.
/// - messages: a newer one replaces those on the same topic that no frame follows. No other message
///   is dropped. Overflow means that the peer does not read, and the owner closes the connection.
/// Not thread-safe.
class PacketRing {
 public:
  struct Limits {
    std::size_t frames = 8;
    std::size_t frame_bytes = 8u << 20;
    std::size_t messages = 64;
    std::size_t message_bytes = 4u << 20;
  };
  struct Packet {
    std::optional<FrameTicket> frame;            // none: a message
    std::vector<std::byte> bytes;                // the bitstream, or the message as it goes out
    Topic topic = Topic::event;                  // of a message
    std::shared_ptr<const PackedDepths> depths;  // of a frame; null: none
  };

  PacketRing() = default;
  explicit PacketRing(const Limits& limits) : limits_(limits) {}

  /// False: the ring is full of messages.
  [[nodiscard]] bool push(OutgoingMessage message);
  /// Returns the ids of the dropped frames, possibly the pushed one; empty: none.
  [[nodiscard]] std::vector<std::uint64_t> push(OutgoingFrame frame);
  /// Returns the oldest packet, or nothing.
  std::optional<Packet> pop();

  [[nodiscard]] bool empty() const { return packets_.empty(); }
  [[nodiscard]] std::size_t frames() const { return frames_; }
  [[nodiscard]] std::size_t frame_bytes() const { return frame_bytes_; }

 private:
  void drop_waiting_frames(std::vector<std::uint64_t>& dropped);
  void drop_outdated_messages(Topic newer);

  Limits limits_;
  std::deque<Packet> packets_;
  std::size_t frames_ = 0;
  std::size_t frame_bytes_ = 0;
  std::size_t message_bytes_ = 0;
  bool waiting_for_idr_ = false;
};

}  // namespace catgs

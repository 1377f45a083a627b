#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <vector>

#include "server/pipeline/frame_ticket.h"

namespace catgs {

/// What waits for one socket, in order: messages and frames. Bounded in number and bytes:
/// - frames: overflow drops every waiting frame and refuses new ones up to the next IDR, because a
///   decoder can make nothing of a P-frame whose predecessor is missing; each is counted;
/// - messages: a newer one replaces those about the same thing that no frame stands behind. No
///   other is dropped; their overflow means that the peer does not read, and the owner closes the
///   connection.
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
    std::optional<FrameTicket> frame;  // none: a message
    std::vector<std::byte> bytes;      // the bitstream, or the message as it goes out
    Topic topic = Topic::event;        // of a message
  };

  PacketRing() = default;
  explicit PacketRing(const Limits& limits) : limits_(limits) {}

  /// False: the ring is full of messages.
  [[nodiscard]] bool push(OutgoingMessage message);
  /// Ids of the frames that this push dropped, possibly the pushed one; empty when all is well.
  [[nodiscard]] std::vector<std::uint64_t> push(OutgoingFrame frame);
  /// Oldest packet, or nothing.
  std::optional<Packet> pop();

  [[nodiscard]] bool empty() const { return packets_.empty(); }
  [[nodiscard]] std::size_t frames() const { return frames_; }
  [[nodiscard]] std::size_t frame_bytes() const { return frame_bytes_; }
  [[nodiscard]] std::uint64_t dropped_frames() const { return dropped_frames_; }

 private:
  void drop_waiting_frames(std::vector<std::uint64_t>& dropped);
  void drop_outdated_messages(Topic newer);

  Limits limits_;
  std::deque<Packet> packets_;
  std::size_t frames_ = 0;
  std::size_t frame_bytes_ = 0;
  std::size_t message_bytes_ = 0;
  std::uint64_t dropped_frames_ = 0;
  bool waiting_for_idr_ = false;
};

}  // namespace catgs

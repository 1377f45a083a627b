#include "server/pipeline/packet_ring.h"

#include <utility>

namespace catgs {

bool PacketRing::push(std::vector<std::byte> message) {
  if (packets_.size() - frames_ >= limits_.messages) return false;
  packets_.push_back({std::nullopt, std::move(message)});
  return true;
}

std::vector<std::uint64_t> PacketRing::push(OutgoingFrame frame) {
  std::vector<std::uint64_t> dropped;
  const std::size_t size = frame.bitstream.size();
  const bool fits =
      frames_ < limits_.frames &&
      (frames_ == 0 || frame_bytes_ + size <= limits_.frame_bytes);  // one frame always fits
  if (!fits) {
    drop_waiting_frames(dropped);
    waiting_for_idr_ = true;
  }
  if (waiting_for_idr_ && !frame.ticket.idr) {
    dropped.push_back(frame.ticket.frame_id);
  } else {
    waiting_for_idr_ = false;
    ++frames_;
    frame_bytes_ += size;
    packets_.push_back({frame.ticket, std::move(frame.bitstream)});
  }
  dropped_frames_ += dropped.size();
  return dropped;
}

std::optional<PacketRing::Packet> PacketRing::pop() {
  if (packets_.empty()) return std::nullopt;
  Packet packet = std::move(packets_.front());
  packets_.pop_front();
  if (packet.frame) {
    --frames_;
    frame_bytes_ -= packet.bytes.size();
  }
  return packet;
}

void PacketRing::drop_waiting_frames(std::vector<std::uint64_t>& dropped) {
  std::erase_if(packets_, [&](const Packet& packet) {
    if (packet.frame) dropped.push_back(packet.frame->frame_id);
    return packet.frame.has_value();
  });
  frames_ = 0;
  frame_bytes_ = 0;
}

}  // namespace catgs

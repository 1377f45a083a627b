#include "server/pipeline/packet_ring.h"

#include <algorithm>
#include <utility>

namespace catgs {

namespace {

/// A welcome also describes the stream's encoding.
bool outdates(Topic newer, Topic older) {
  if (newer == Topic::event) return false;
  return older == newer || (newer == Topic::session && older == Topic::stream);
}

}  // namespace

bool PacketRing::push(OutgoingMessage message) {
  drop_outdated_messages(message.topic);
  const std::size_t size = message.bytes.size();
  const std::size_t messages = packets_.size() - frames_;
  const bool fits =
      messages < limits_.messages &&
      (messages == 0 || message_bytes_ + size <= limits_.message_bytes);  // one always fits
  if (!fits) return false;
  message_bytes_ += size;
  packets_.push_back({std::nullopt, std::move(message.bytes), message.topic, nullptr});
  return true;
}

/// A message before a waiting frame stays: the client needs it to show that frame.
void PacketRing::drop_outdated_messages(Topic newer) {
  const auto last_frame = std::find_if(packets_.rbegin(), packets_.rend(),
                                       [](const Packet& packet) { return packet.frame; });
  const auto outdated =
      std::stable_partition(last_frame.base(), packets_.end(),
                            [&](const Packet& packet) { return !outdates(newer, packet.topic); });
  for (auto packet = outdated; packet != packets_.end(); ++packet)
    message_bytes_ -= packet->bytes.size();
  packets_.erase(outdated, packets_.end());
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
    packets_.push_back(
        {frame.ticket, std::move(frame.bitstream), Topic::event, std::move(frame.depths)});
  }
  return dropped;
}

std::optional<PacketRing::Packet> PacketRing::pop() {
  if (packets_.empty()) return std::nullopt;
  Packet packet = std::move(packets_.front());
  packets_.pop_front();
  if (packet.frame) {
    --frames_;
    frame_bytes_ -= packet.bytes.size();
  } else {
    message_bytes_ -= packet.bytes.size();
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

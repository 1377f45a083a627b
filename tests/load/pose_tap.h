#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "proto/catgs.pb.h"

namespace catgs::load {

/// Reads along what one browser connection sends, unencrypted: passes over the HTTP request, then,
/// where that asks for a WebSocket, takes its messages apart (RFC 6455) and hands on the pose
/// samples of catgs.v1. What it does not understand it leaves alone: nothing is changed or held up.
/// Pure; memory is bounded by the longest message of the protocol.
class PoseTap {
 public:
  explicit PoseTap(std::function<void(const v1::PoseSample&)> on_pose)
      : on_pose_(std::move(on_pose)) {}

  void read(std::span<const std::byte> bytes);

 private:
  /// Takes a whole head or frame from the front of buffer_; false: it is not all there.
  bool take_head();
  bool take_frame();

  enum class State { head, frames, deaf };
  State state_ = State::head;
  std::vector<std::byte> buffer_;
  std::vector<std::byte> message_;  // of a fragmented message, so far
  std::function<void(const v1::PoseSample&)> on_pose_;
};

}  // namespace catgs::load

#pragma once

#include <chrono>

#include "server/pipeline/frame_ticket.h"

namespace catgs {

/// What the frames of one session cost, smoothed, and which kind the next one will be. Pure; not
/// thread-safe.
class NextFrameCost {
 public:
  void add(const FrameTicket& ticket) {
    add_to(encode_, ticket.encode_end - ticket.render_end);
    if (ticket.refined) return;
    add_to(ticket.speculated ? sub_ : key_, ticket.render_end - ticket.render_start);
    sub_frames_left_ = ticket.speculated ? sub_frames_left_ - 1 : static_cast<int>(ticket.window);
  }

  /// The window of the last key frame is used up. A core may still decide otherwise: a key frame
  /// sooner where the camera left its guard set, a sub-frame where it stays within for longer.
  [[nodiscard]] bool key_is_next() const { return sub_frames_left_ <= 0; }
  /// Of the next frame: rendering and encoding, 0 before the first.
  [[nodiscard]] Clock::duration next() const { return (key_is_next() ? key_ : sub_) + encode_; }
  [[nodiscard]] Clock::duration refinement() const { return encode_; }

 private:
  static void add_to(Clock::duration& mean, Clock::duration cost) {
    mean = mean == Clock::duration{} ? cost : mean + (cost - mean) / 8;
  }

  Clock::duration key_{};
  Clock::duration sub_{};
  Clock::duration encode_{};
  int sub_frames_left_ = 0;
};

}  // namespace catgs

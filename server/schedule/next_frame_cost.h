#pragma once

#include <chrono>

#include "server/pipeline/frame_ticket.h"

namespace catgs {

/// Predicts the cost of a session's next frame and whether it is a key frame. Costs are smoothed.
/// Pure; not thread-safe.
class NextFrameCost {
 public:
  /// Adds the cost of a finished frame.
  void add(const FrameTicket& ticket) {
    const Clock::duration encode = ticket.encode->end - ticket.render->end;
    if (ticket.still) {
      if (ticket.refined) return add_to(refine_, encode);
      return add_to(still_, ticket.encode->end - ticket.render->start);
    }
    add_to(encode_, encode);
    add_to(ticket.speculated ? sub_ : key_, ticket.render->end - ticket.render->start);
    sub_frames_left_ = ticket.speculated ? sub_frames_left_ - 1 : static_cast<int>(ticket.window);
  }

  /// True: the last key frame's window is used up. A core may decide otherwise.
  [[nodiscard]] bool key_is_next() const { return sub_frames_left_ <= 0; }
  /// The predicted cost of rendering and encoding the next frame; 0 before the first.
  [[nodiscard]] Clock::duration next() const { return (key_is_next() ? key_ : sub_) + encode_; }
  /// The predicted cost of a still. Before the first still, it is that of a frame in motion.
  [[nodiscard]] Clock::duration still() const {
    return still_ == Clock::duration{} ? key_ + encode_ : still_;
  }
  [[nodiscard]] Clock::duration refinement() const {
    return refine_ == Clock::duration{} ? encode_ : refine_;
  }

 private:
  static void add_to(Clock::duration& mean, Clock::duration cost) {
    mean = mean == Clock::duration{} ? cost : mean + (cost - mean) / 8;
  }

  Clock::duration key_{};
  Clock::duration sub_{};
  Clock::duration encode_{};
  Clock::duration still_{};
  Clock::duration refine_{};
  int sub_frames_left_ = 0;
};

}  // namespace catgs

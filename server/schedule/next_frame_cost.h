#pragma once

#include <chrono>

#include "server/pipeline/frame_ticket.h"

namespace catgs {

/// Predicts the cost of a session's next frame. Costs are smoothed. Pure; not thread-safe.
class NextFrameCost {
 public:
  /// Adds the cost of a finished frame.
  void add(const FrameTicket& ticket) {
    const Clock::duration encode = ticket.encode->end - ticket.render->end;
    if (ticket.still) {
      if (ticket.refined) return add_to(refine_, encode);
      return add_to(still_, ticket.encode->end - ticket.render->start);
    }
    add_to(render_, ticket.render->end - ticket.render->start);
    add_to(encode_, encode);
  }

  /// The predicted cost of rendering and encoding the next frame; 0 before the first.
  [[nodiscard]] Clock::duration next() const { return render_ + encode_; }
  [[nodiscard]] Clock::duration render() const { return render_; }
  /// The predicted cost of a still. Before the first still, it is that of a frame in motion.
  [[nodiscard]] Clock::duration still() const {
    return still_ == Clock::duration{} ? next() : still_;
  }
  [[nodiscard]] Clock::duration refinement() const {
    return refine_ == Clock::duration{} ? encode_ : refine_;
  }

 private:
  static void add_to(Clock::duration& mean, Clock::duration cost) {
    mean = mean == Clock::duration{} ? cost : mean + (cost - mean) / 8;
  }

  Clock::duration render_{};
  Clock::duration encode_{};
  Clock::duration still_{};
  Clock::duration refine_{};
};

}  // namespace catgs

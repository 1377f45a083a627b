#pragma once

#include <cstddef>
#include <optional>
#include <span>

#include "server/pipeline/frame_ticket.h"

namespace catgs {

/// A session that could start a frame.
struct FrameCandidate {
  TimePoint ready;     // not before (its nominal rate)
  TimePoint deadline;  // when its nominal rate says that the frame is due
};

/// Who renders next on one device: earliest deadline first. Each frame moves its session's deadline
/// on from the moment it started, so that under overload the sessions take turns: everyone's rate
/// falls and nobody starves. Pure; not thread-safe.
class FrameScheduler {
 public:
  explicit FrameScheduler(int slots) : slots_(slots) {}

  [[nodiscard]] bool has_free_slot() const { return running_ < slots_; }
  void frame_started() { ++running_; }
  void frame_ended() { --running_; }
  [[nodiscard]] int running() const { return running_; }

  /// Index of the candidate to start now; none: nobody is ready.
  [[nodiscard]] static std::optional<std::size_t> choose(std::span<const FrameCandidate> candidates,
                                                         TimePoint now);

 private:
  int slots_;
  int running_ = 0;
};

}  // namespace catgs

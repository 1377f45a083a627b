#pragma once

#include <cstddef>
#include <map>
#include <optional>
#include <span>

#include "server/pipeline/frame_ticket.h"

namespace catgs {

/// A session that could start a frame.
struct FrameCandidate {
  TimePoint ready;              // not before (its nominal rate)
  TimePoint deadline;           // when its nominal rate says that the frame is due
  Clock::duration cost{};       // measured: what it will probably take
  bool key = false;             // probably a key frame
  std::optional<int> device{};  // that renders it, where devices have numbers
};

/// Who renders next: earliest deadline first, the deadline being the last moment at which a frame
/// can start to be ready in time by what its session's frames have cost. Each frame moves its
/// session's deadline on from the moment it started, so that under overload the sessions take
/// turns: everyone's rate falls and nobody starves. Key frames cost several times a sub-frame, and
/// sessions that began together need theirs together: while a device renders one, sub-frames go
/// first there, as long as the next key frame can wait without missing its deadline. No slot stays
/// empty for it. One device takes no more than its share of the slots, or where it cannot keep up
/// its frames, late as they are, would leave none to the others. Pure; not thread-safe.
class FrameScheduler {
 public:
  /// `devices`: that candidates name; none, or one: all slots are its own.
  explicit FrameScheduler(int slots, int devices = 1)
      : slots_(slots), slots_of_device_(devices > 1 ? (slots + devices - 1) / devices : slots) {}

  [[nodiscard]] bool has_free_slot() const { return running_ < slots_; }
  void frame_started(const FrameCandidate& frame);
  /// `frame` is what frame_started() was told.
  void frame_ended(const FrameCandidate& frame);
  [[nodiscard]] int running() const { return running_; }

  /// Index of the candidate to start now; none: nobody is ready.
  [[nodiscard]] std::optional<std::size_t> choose(std::span<const FrameCandidate> candidates,
                                                  TimePoint now) const;

 private:
  struct OnDevice {
    int frames = 0;
    int key_frames = 0;
  };

  [[nodiscard]] OnDevice running_on(std::optional<int> device) const;

  int slots_;
  int slots_of_device_;
  int running_ = 0;
  std::map<std::optional<int>, OnDevice> running_on_;
};

}  // namespace catgs

#pragma once

#include <array>
#include <functional>
#include <list>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>

#include "server/base/clock.h"

namespace catgs {

/// Watches the threads that serve visitors, for /healthz and /readyz. The network thread answers
/// these requests, which proves that it runs. The loader thread is not watched, because loading may
/// take any time. Thread-safe.
class Liveness {
 public:
  explicit Liveness(std::function<TimePoint()> clock = Clock::now);

  /// Records a round of the session thread, which comes four times a second.
  void session_moved();
  /// A frame is being rendered or encoded for as long as the result lives.
  [[nodiscard]] std::shared_ptr<const void> frame_started();

  struct Loop {
    std::string_view name;
    Clock::duration stalled;   // time since it last moved; for frames the oldest one's age
    Clock::duration patience;  // beyond it, the process has to be restarted
  };
  [[nodiscard]] std::array<Loop, 2> loops() const;
  /// Names the loops that have stalled for too long, for people; empty: none.
  [[nodiscard]] std::string complaint() const;

 private:
  struct Frames {
    std::mutex mutex;
    std::list<TimePoint> started;  // oldest first
  };

  /// One frame under way, for its lifetime.
  class Frame {
   public:
    Frame(std::shared_ptr<Frames> all, const std::function<TimePoint()>& clock);
    ~Frame();
    Frame(const Frame&) = delete;
    Frame& operator=(const Frame&) = delete;

   private:
    const std::shared_ptr<Frames> all_;
    std::list<TimePoint>::iterator started_;
  };

  const std::function<TimePoint()> clock_;
  mutable std::mutex mutex_;
  TimePoint session_moved_;
  const std::shared_ptr<Frames> frames_ = std::make_shared<Frames>();  // no Frame outlives it
};

}  // namespace catgs

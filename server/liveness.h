#pragma once

#include <array>
#include <functional>
#include <list>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>

#include "server/pipeline/frame_ticket.h"

namespace catgs {

/// Whether the threads that serve visitors move on, for /healthz and /readyz. The network thread
/// answers those: that it does is its own sign of life. Scenes are loaded on a thread that may take
/// as long as it likes. Every member may be used from any thread.
class Liveness {
 public:
  explicit Liveness(std::function<TimePoint()> clock = Clock::now);

  /// The session thread has come round, as it does four times a second.
  void session_moved();
  /// A frame is in the hands of those who render and encode for as long as the result lives.
  [[nodiscard]] std::shared_ptr<const void> frame_started();

  struct Loop {
    std::string_view name;
    Clock::duration stalled;   // since it last moved; of frames: the oldest one's age
    Clock::duration patience;  // beyond it, somebody has to start the process anew
  };
  [[nodiscard]] std::array<Loop, 2> loops() const;
  /// The loops that have not moved for too long, for people; empty: all is well.
  [[nodiscard]] std::string complaint() const;

 private:
  struct Frames {
    std::mutex mutex;
    std::list<TimePoint> started;  // oldest first
  };

  /// One of them, while it lives.
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
  const std::shared_ptr<Frames> frames_ = std::make_shared<Frames>();  // outlived by none of them
};

}  // namespace catgs

#pragma once

#include <functional>
#include <string>
#include <utility>

#include "server/schedule/frame_executor.h"

namespace catgs {

/// Detects devices that are lost for good. One failure may be transient, such as a driver reset. If
/// no device makes a View after a second failure, with no good frame in between, only a new process
/// may help. Lack of memory does not count. Not thread-safe.
class DeviceFailures {
 public:
  using OnLost = std::function<void(const std::string& why)>;

  explicit DeviceFailures(OnLost on_lost) : on_lost_(std::move(on_lost)) {}

  void stream_opened(const StreamOpened& opened) {
    if (opened.fault == Fault::device_failed && ++since_good_frame_ > 1) on_lost_(opened.message);
  }
  void frame_ended(const FrameResult& result) {
    if (result.fault == Fault::device_failed) ++since_good_frame_;
    if (result.ok && !result.frame.ticket.refined) since_good_frame_ = 0;
  }

 private:
  const OnLost on_lost_;
  int since_good_frame_ = 0;
};

}  // namespace catgs

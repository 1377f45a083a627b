#pragma once

#include "server/net/messages.h"
#include "server/schedule/frame_executor.h"

namespace catgs {

class Place;

/// The path of frames from pose to photon (server/frame_path.h), as places see it. Session thread
/// only.
class Frames {
 public:
  virtual ~Frames() = default;
  virtual void pose_arrived(Place& place, const PoseSample& pose, TimePoint received) = 0;
  virtual void seen(Place& place, const Ack& ack, TimePoint now) = 0;
  virtual void stream_opened(Place& place, const StreamOpened& opened) = 0;
  /// Something else about the place has changed: a frame of it may be due, or none any more.
  virtual void changed(Place& place) = 0;
  /// The place ends.
  virtual void withdraw(Place& place) = 0;
};

}  // namespace catgs

#pragma once

#include "server/net/messages.h"
#include "server/schedule/frame_executor.h"

namespace catgs {

class Session;

/// The path of frames from pose to photon (server/frame_path.h), as sessions see it. Session thread
/// only.
class Frames {
 public:
  virtual ~Frames() = default;
  virtual void pose_arrived(Session& session, const PoseSample& pose, TimePoint received) = 0;
  virtual void seen(Session& session, const Ack& ack, TimePoint now) = 0;
  virtual void stream_opened(Session& session, const StreamOpened& opened) = 0;
  /// Something else about the session has changed: a frame of it may be due, or none any more.
  virtual void changed(Session& session) = 0;
  /// The session ends.
  virtual void withdraw(Session& session) = 0;
};

}  // namespace catgs

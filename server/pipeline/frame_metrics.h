#pragma once

#include "server/base/metrics.h"
#include "server/pipeline/frame_ticket.h"

namespace catgs {

/// Records the stage durations of a frame that was rendered, encoded and handed to the socket at
/// `now`.
void observe_frame(Metrics& metrics, const FrameTicket& ticket, TimePoint now);

}  // namespace catgs

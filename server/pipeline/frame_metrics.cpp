#include "server/pipeline/frame_metrics.h"

#include <cassert>
#include <chrono>

namespace catgs {
namespace {

double seconds(TimePoint from, TimePoint to) {
  return std::chrono::duration<double>(to - from).count();
}

}  // namespace

void observe_frame(Metrics& metrics, const FrameTicket& ticket, TimePoint now) {
  assert(ticket.render && ticket.encode);
  metrics.encode_wait_seconds.Observe(seconds(ticket.render->end, ticket.encode->start));
  metrics.encode_seconds.Observe(seconds(ticket.encode->start, ticket.encode->end));
  metrics.send_seconds.Observe(seconds(ticket.encode->end, now));
  if (ticket.still) return;  // late on purpose, and perhaps larger
  metrics.queue_wait_seconds.Observe(seconds(ticket.ready, ticket.started));
  metrics.hand_off_seconds.Observe(seconds(ticket.started, ticket.render->start));
  metrics.render_seconds.Observe(seconds(ticket.render->start, ticket.render->end));
  metrics.pose_to_frame_seconds.Observe(seconds(ticket.pose_received, now));
}

}  // namespace catgs

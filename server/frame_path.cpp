// The path of a frame. Bytes come in on the network thread and are posted to the session thread
// (visit/client_connection). From there each step below leads to the next one.
#include "server/frame_path.h"

#include <utility>

#include "server/schedule/on_session_thread.h"

namespace catgs {

FramePath::FramePath(boost::asio::io_context& io, std::shared_ptr<FrameExecutor> executor,
                     int devices, DeviceFailures::OnLost on_devices_lost, Metrics& metrics)
    : io_(io),
      executor_(std::move(executor)),
      device_failures_(std::move(on_devices_lost)),
      metrics_(metrics),
      scheduler_(executor_->slots(), devices),
      timer_(io) {}

/// 1. A pose has arrived. The visit records the camera and its forecast.
void FramePath::pose_arrived(Session& session, const PoseSample& pose, TimePoint received) {
  session.visit().on_message(pose, received);
  changed(session);
}

/// A frame of this session may now be due.
void FramePath::changed(Session& session) {
  scheduler_.changed(session, Clock::now());
  start_due();
}

/// 2. Due frames start while a slot is free, the most urgent first.
void FramePath::start_due() {
  TimePoint now = Clock::now();
  scheduler_.set_slots(executor_->slots());
  for (; const auto turn = scheduler_.take(now); now = Clock::now()) draw(*turn, now);
  const auto next = scheduler_.next_ready();
  if (next == wakes_at_) return;
  wakes_at_ = next;
  timer_.cancel();
  if (!next) return;
  timer_.expires_at(*next);
  timer_.async_wait([this, next](const boost::system::error_code& error) {
    if (error || wakes_at_ != next) return;  // an outdated wait that could not be cancelled
    wakes_at_.reset();
    start_due();
  });
}

/// 3. The visit decides what to draw. The executor draws and encodes it on its own threads.
void FramePath::draw(const Scheduler::Turn& turn, TimePoint now) {
  Session& session = turn.source;
  FrameJob job{session.visit().start_frame(now), session.stream()};
  job.ticket.ready = turn.ready;
  job.ticket.started = now;
  session.usage().frame_started(now);
  metrics_.frames_running.Set(scheduler_.running());
  auto done = [this, frame = turn.frame, self = session.shared_from_this()](FrameResult result) {
    scheduler_.frame_ended(frame);
    encoded(*self, std::move(result));
  };
  executor_->submit(std::move(job), on_session_thread<FrameResult>(io_, std::move(done)));
}

/// 4. The frame is encoded or has failed. The visit decides what becomes of it. Usually its session
/// sends it: 5. to the rings of the visitor's and spectators' sockets (visit/audience).
void FramePath::encoded(Session& session, FrameResult result) {
  const TimePoint now = Clock::now();
  metrics_.frames_running.Set(scheduler_.running());
  device_failures_.frame_ended(result);
  session.account_for(result, now);
  session.visit().on_frame(std::move(result), now);
  changed(session);
}

/// 6. The frame was seen. An acknowledgement for an unknown or already settled frame is not
/// measured.
void FramePath::seen(Session& session, const Ack& ack, TimePoint now) {
  const CreditWindow& credit = session.visit().flow().credit();
  const int in_flight = credit.in_flight();
  session.visit().on_message(ack, now);
  if (credit.in_flight() < in_flight) {
    if (ack.dropped) metrics_.frames_dropped_by_client.Increment();
    if (ack.presented_us > 0) {
      metrics_.motion_to_photon_seconds.Observe(1e-6 * ack.pose_age_us);
      session.usage().frame_shown(1e-6 * ack.pose_age_us);
    }
  }
  changed(session);
}

/// Before the first frame, the executor has made a View and an encoder, or failed.
void FramePath::stream_opened(Session& session, const StreamOpened& opened) {
  if (!opened.ok) metrics_.streams_failed.Increment();
  device_failures_.stream_opened(opened);
  session.visit().on_stream_opened(opened, Clock::now());
  changed(session);
}

}  // namespace catgs

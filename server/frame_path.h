#pragma once

#include <memory>
#include <optional>

#include <boost/asio/io_context.hpp>
#include <boost/asio/steady_timer.hpp>

#include "server/base/metrics.h"
#include "server/schedule/device_failures.h"
#include "server/schedule/frame_executor.h"
#include "server/schedule/scheduler.h"
#include "server/visit/session.h"

namespace catgs {

/// The path of every frame, from the pose that requests it to the acknowledgement of its display.
/// The steps are in this order in frame_path.cpp. All run on the session thread.
class FramePath : public Frames {
 public:
  /// `devices` is the number of rendering devices; 1 for the CPU.
  FramePath(boost::asio::io_context& io, std::shared_ptr<FrameExecutor> executor, int devices,
            DeviceFailures::OnLost on_devices_lost, Metrics& metrics);

  void pose_arrived(Session& session, const PoseSample& pose, TimePoint received) override;
  void changed(Session& session) override;
  void seen(Session& session, const Ack& ack, TimePoint now) override;
  void stream_opened(Session& session, const StreamOpened& opened) override;
  void withdraw(Session& session) override { scheduler_.withdraw(session); }

 private:
  using Scheduler = FrameScheduler<Session>;

  void start_due();
  void draw(const Scheduler::Turn& turn, TimePoint now);
  void encoded(Session& session, FrameResult result);

  boost::asio::io_context& io_;
  const std::shared_ptr<FrameExecutor> executor_;
  DeviceFailures device_failures_;
  Metrics& metrics_;
  Scheduler scheduler_;
  boost::asio::steady_timer timer_;
  std::optional<TimePoint> wakes_at_;
};

}  // namespace catgs

#pragma once

#include "render_core/base/thread_pool.h"
#include "server/visit/session.h"

namespace catgs {

/// For VisitOptions: reads the CPU limit, of which `threads` (0: all) may be used. Without that
/// number the pool follows: it gets the threads that the limit keeps busy.
std::function<double()> cpus_for(std::shared_ptr<ThreadPool> pool, int threads);

/// Measures what sessions take of the machine. From that it charges processor time, balances
/// devices and controls the effort of software encoders. Session thread only.
class MachineUse {
 public:
  explicit MachineUse(const VisitContext& around);

  /// Call it four times a second.
  void on_tick(const SessionList& sessions, int admitted, TimePoint now);
  /// Seconds of processor time a second that the server may use, as measured lately.
  [[nodiscard]] double cpus() const { return cpus_; }
  /// The effort for a newcomer. `sessions` includes it.
  [[nodiscard]] EncoderEffort initial_effort(int sessions, glm::ivec2 size_px) const {
    return effort_.initial(sessions, size_px);
  }

 private:
  /// Divides the processor time since the last call among the sessions.
  void charge_cpu(const SessionList& sessions, TimePoint now);
  /// Reports the measured loads to the devices.
  void report_loads(const SessionList& sessions);
  /// Changes encoder efforts where the measurements ask for it.
  void control_effort(const SessionList& sessions, int admitted, TimePoint now);

  /// Follows a quota that was changed.
  void follow_cpus(TimePoint now);

  const VisitContext& around_;
  double cpus_;
  TimePoint cpus_read_;
  EffortControl effort_;
  double cpu_seconds_charged_;
  TimePoint charged_;
  double busy_ = 0.0;  // recent share of the processors' time
};

}  // namespace catgs

#pragma once

#include "server/visit/session.h"

namespace catgs {

/// Measures what sessions take of the machine. From that it charges processor time, balances
/// devices and controls the effort of software encoders. Session thread only.
class MachineUse {
 public:
  explicit MachineUse(const VisitContext& around);

  /// Call it four times a second.
  void on_tick(const SessionList& sessions, int admitted, TimePoint now);
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

  const VisitContext& around_;
  EffortControl effort_;
  double cpu_seconds_charged_;
  TimePoint charged_;
  double busy_ = 0.0;  // recent share of the processors' time
};

}  // namespace catgs

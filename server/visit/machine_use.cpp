#include "server/visit/machine_use.h"

#include <cmath>
#include <utility>

#include "server/base/log_event.h"
#include "server/visit/device_loads.h"

namespace catgs {

MachineUse::MachineUse(const VisitContext& around)
    : around_(around),
      effort_(around.options.cpus, around.options.presets),
      cpu_seconds_charged_(process_cpu_seconds()),
      charged_(Clock::now()) {}

void MachineUse::on_tick(const SessionList& sessions, int admitted, TimePoint now) {
  charge_cpu(sessions, now);
  report_loads(sessions);
  control_effort(sessions, admitted, now);
  around_.metrics.processors_busy.Set(busy_);
}

void MachineUse::charge_cpu(const SessionList& sessions, TimePoint now) {
  const double used = process_cpu_seconds();
  const double seconds = used - std::exchange(cpu_seconds_charged_, used);
  const double interval_s =
      std::chrono::duration<double>(now - std::exchange(charged_, now)).count();
  if (interval_s <= 0) return;
  constexpr double span_s = 1.0;
  busy_ += (seconds / interval_s / around_.options.cpus - busy_) *
           (1.0 - std::exp(-interval_s / span_s));
  std::vector<double> busy_seconds;
  for (const auto& session : sessions)
    busy_seconds.push_back(session->usage().take_busy_seconds(now));
  const auto shares = share_out(seconds, busy_seconds);
  for (std::size_t i = 0; i < sessions.size(); ++i)
    sessions[i]->usage().charge_cpu(shares[i], interval_s);
}

void MachineUse::report_loads(const SessionList& sessions) {
  std::vector<DeviceSession> loads;
  for (const auto& session : sessions)
    if (const auto device = session->visit().stream().device())
      loads.push_back({*device, session->usage().gpu_load()});
  around_.devices.set_loads(device_loads(loads));
}

void MachineUse::control_effort(const SessionList& sessions, int admitted, TimePoint now) {
  std::vector<EffortControl::Session> encoding;
  SessionList encoders;
  for (const auto& session : sessions) {
    const Visit& visit = session->visit();
    const StreamControl& stream = visit.stream();
    if (stream.encoder_kind() != EncoderKind::x264 || !visit.life().on_show() || stream.opening())
      continue;
    const SessionUsage& usage = session->usage();
    const EncoderEffort effort = stream.plan().effort();
    const std::chrono::duration<double> interval = visit.frame_interval();
    encoding.push_back({effort, usage.encoder_load() * effort.threads,
                        usage.encode_seconds() / interval.count(), stream.plan().moving().size_px});
    encoders.push_back(session);
  }
  for (const auto& [index, effort] : effort_.update(busy_, admitted, encoding, now)) {
    around_.metrics.effort_changes.Increment();
    const LogScope about(encoders[index]->facts());
    log_debug({.event = "encoder_effort"},
              "libx264 continues with {}, {} threads: processors {:.0f} % busy",
              effort_presets[static_cast<std::size_t>(effort.preset)].name, effort.threads,
              100.0 * busy_);
    encoders[index]->visit().stream().plan().use_effort(effort);
  }
}

}  // namespace catgs

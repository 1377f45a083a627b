#include "server/visit/machine_use.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "render_core/base/cpu_limit.h"
#include "server/base/log_event.h"
#include "server/visit/device_loads.h"

namespace catgs {

std::function<double()> cpus_for(std::shared_ptr<ThreadPool> pool, int threads) {
  return [pool = std::move(pool), threads, limit = CpuLimit()] {
    const double cpus = limit.cpus();
    if (threads > 0) return std::min(cpus, static_cast<double>(threads));
    if (threads_for(cpus) != pool->threads()) pool->set_threads(threads_for(cpus));
    return cpus;
  };
}

MachineUse::MachineUse(const VisitContext& around)
    : around_(around),
      cpus_(around.options.cpus()),
      cpus_read_(Clock::now()),
      effort_(cpus_, around.options.presets),
      cpu_seconds_charged_(process_cpu_seconds()),
      charged_(Clock::now()) {}

void MachineUse::on_tick(const SessionList& sessions, int admitted, TimePoint now) {
  follow_cpus(now);
  charge_cpu(sessions, now);
  report_loads(sessions);
  control_effort(sessions, admitted, now);
  around_.metrics.processors.Set(cpus_);
  around_.metrics.processors_busy.Set(busy_);
}

void MachineUse::follow_cpus(TimePoint now) {
  if (now - cpus_read_ < std::chrono::seconds(1)) return;
  cpus_read_ = now;
  const double cpus = around_.options.cpus();
  if (cpus == std::exchange(cpus_, cpus)) return;
  effort_.set_cpus(cpus);
  log_info({.event = "cpu_limit"}, "the server may use {:.2f} processors now", cpus);
}

void MachineUse::charge_cpu(const SessionList& sessions, TimePoint now) {
  const double used = process_cpu_seconds();
  const double seconds = used - std::exchange(cpu_seconds_charged_, used);
  const double interval_s =
      std::chrono::duration<double>(now - std::exchange(charged_, now)).count();
  if (interval_s <= 0) return;
  constexpr double span_s = 1.0;
  busy_ += (seconds / interval_s / cpus_ - busy_) * (1.0 - std::exp(-interval_s / span_s));
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
    encoding.push_back({effort, usage.encoder_load() * std::min(effort.threads, max_h264_slices),
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

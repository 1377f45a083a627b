// What the registry measures four times a second, and what follows from it.
#include <cmath>
#include <utility>

#include <spdlog/spdlog.h>

#include "server/session/device_loads.h"
#include "server/session/log_session.h"
#include "server/session/session_registry.h"

namespace catgs {

void SessionRegistry::charge_cpu(TimePoint now) {
  const double used = process_cpu_seconds();
  const double seconds = used - std::exchange(cpu_seconds_charged_, used);
  const double interval_s =
      std::chrono::duration<double>(now - std::exchange(charged_, now)).count();
  if (interval_s <= 0) return;
  constexpr double span_s = 1.0;
  busy_ += (seconds / interval_s / options_.cpus - busy_) * (1.0 - std::exp(-interval_s / span_s));
  std::vector<double> busy_seconds;
  for (const auto& client : clients_)
    busy_seconds.push_back(client->usage().take_busy_seconds(now));
  const auto shares = share_out(seconds, busy_seconds);
  for (std::size_t i = 0; i < clients_.size(); ++i)
    clients_[i]->usage().charge_cpu(shares[i], interval_s);
}

void SessionRegistry::report_loads() {
  if (!options_.devices) return;
  std::vector<DeviceSession> sessions;
  for (const auto& client : clients_)
    if (const auto device = client->session().device())
      sessions.push_back({*device, client->usage().gpu_load()});
  options_.devices->set_loads(device_loads(sessions));
}

void SessionRegistry::control_effort(TimePoint now) {
  std::vector<EffortControl::Session> encoding;
  std::vector<Session*> sessions;
  for (const auto& client : clients_) {
    Session& session = client->session();
    if (session.encoder_kind() != EncoderKind::x264 || !session.streams()) continue;
    const SessionUsage& usage = client->usage();
    const std::chrono::duration<double> interval = session.frame_interval();
    encoding.push_back({session.effort(), usage.encoder_load() * session.effort().threads,
                        usage.encode_seconds() / interval.count(), session.moving_size_px()});
    sessions.push_back(&session);
  }
  for (const auto& [index, effort] :
       effort_.update(busy_, static_cast<int>(admitted_), encoding, now)) {
    metrics_.effort_changes.Increment();
    const LogSession about(sessions[index]->id());
    spdlog::debug("libx264 goes on with {}, {} threads: processors {:.0f} % busy",
                  effort_presets[static_cast<std::size_t>(effort.preset)].name, effort.threads,
                  100.0 * busy_);
    sessions[index]->use_effort(effort);
  }
}

void SessionRegistry::publish() {
  auto reports = std::make_shared<std::vector<SessionReport>>();
  reports->reserve(clients_.size());
  std::size_t queued = 0;
  int in_flight = 0;
  int lost = 0;
  std::size_t spectators = 0;
  int stepped_down = 0;
  double target_bits_per_s = 0.0;
  for (const auto& client : clients_) {
    const Session& session = client->session();
    if (session.state() == Session::State::live && !session.lost()) {
      stepped_down += session.flow().steps_down() > 0 ? 1 : 0;
      target_bits_per_s += 1e3 * session.flow().bitrate_kbps();
      metrics_.link_queue_seconds.Observe(
          std::chrono::duration<double>(session.flow().queue_delay()).count());
    }
    queued += client->queued_frames();
    lost += session.lost() ? 1 : 0;
    spectators += client->spectators().size();
    in_flight += session.flow().credit().in_flight();
    reports->emplace_back(*client);
  }
  for (const auto& [encoder, count] : encoders_.in_use())
    metrics_.set_encoder_sessions(encoder, count);
  metrics_.processors_busy.Set(busy_);
  metrics_.connections.Set(connections_);
  metrics_.sessions.Set(admitted_);
  metrics_.sessions_lost.Set(lost);
  metrics_.spectators.Set(static_cast<double>(spectators));
  metrics_.sessions_stepped_down.Set(stepped_down);
  metrics_.target_bits_per_second.Set(target_bits_per_s);
  metrics_.sessions_waiting.Set(static_cast<double>(queue_.size()));
  metrics_.frames_running.Set(scheduler_.running());
  metrics_.frames_queued.Set(static_cast<double>(queued));
  metrics_.frames_in_flight.Set(in_flight);
  const auto demanded = demands();
  const auto load = budget_.load(demanded);
  metrics_.seats.Set(draining_ ? 0 : budget_.seats(demanded, options_.max_sessions));
  metrics_.cpu_budget_used.Set(load.cpus);
  metrics_.gpu_budget_used.Set(load.gpus);
  const std::lock_guard lock(published_mutex_);
  published_ = std::move(reports);
}

std::string SessionRegistry::published_json() const {
  std::shared_ptr<const std::vector<SessionReport>> reports;
  {
    const std::lock_guard lock(published_mutex_);
    reports = published_;
  }
  return to_json(*reports);
}

}  // namespace catgs

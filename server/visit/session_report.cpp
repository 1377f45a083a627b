#include "server/visit/session_report.h"

#include <map>
#include <string_view>
#include <utility>

#include <nlohmann/json.hpp>

namespace catgs {
namespace {

std::string_view state_name(const Visit& visit) {
  if (visit.life().lost()) return "lost";
  switch (visit.life().state()) {
    case VisitState::awaiting_hello:
      return "awaiting_hello";
    case VisitState::queued:
      return "queued";
    case VisitState::opening:
      return "opening";
    case VisitState::live:
      return "live";
    case VisitState::closed:
      break;
  }
  return "closed";
}

nlohmann::json times_json(const SessionUsage& usage) {
  auto times = nlohmann::json::object();
  for (std::size_t i = 0; i < session_time_count; ++i)
    if (const auto p = usage.times(static_cast<SessionTime>(i)).percentiles())
      times[std::string(session_time_names[i])] = {
          {"p50", 1e3 * p->p50}, {"p95", 1e3 * p->p95}, {"p99", 1e3 * p->p99}};
  return times;
}

nlohmann::json report_json(const SessionReport& report) {
  const auto preset_name = [](int preset) {
    return effort_presets[static_cast<std::size_t>(preset)].name;
  };
  using nlohmann::json;
  return {
      {"id", report.id},
      {"state", report.state},
      {"paused", report.paused},
      {"spectators", report.spectators},
      {"scene", report.scene_id},
      {"width_px", report.config.size_px.x},
      {"height_px", report.config.size_px.y},
      {"device", report.device ? json(*report.device) : json()},
      {"encoder", report.config.encoder},
      {"preset", report.effort ? json(preset_name(report.effort->preset)) : json()},
      {"encoder_threads", report.effort ? json(report.effort->threads) : json()},
      {"encoder_load", report.usage.encoder_load()},
      {"frames_sent", report.frames_sent},
      {"frames_dropped", report.frames_dropped},
      {"bytes_sent", report.bytes_sent},
      {"frames_in_flight", report.frames_in_flight},
      {"credit", report.credit},
      {"base_rtt_us", report.base_rtt.count()},
      {"queue_delay_us", report.queue_delay.count()},
      {"target_bitrate_kbps", report.target_bitrate_kbps},
      {"steps_down", report.steps_down},
      {"tcp_rtt_us", report.link.rtt_us},
      {"tcp_delivery_kbps", report.link.delivery_bits_per_s / 1000},
      {"tcp_window_bytes", report.link.window_bytes},
      {"tcp_unsent_bytes", report.link.unsent_bytes},
      {"frames_queued", report.frames_queued},
      {"cpu_seconds", report.usage.cpu_seconds()},
      {"gpu_seconds", report.usage.gpu_seconds()},
      {"times_ms", times_json(report.usage)},
  };
}

}  // namespace

SessionReport::SessionReport(Session& session)
    : id(session.id()),
      state(state_name(session.visit())),
      paused(session.visit().life().paused()),
      spectators(session.audience().spectators()),
      scene_id(session.visit().stream().scene() ? session.visit().stream().scene()->facts.scene_id
                                                : ""),
      config(session.visit().stream().config()),
      device(session.visit().stream().device()),
      frames_sent(session.visit().statistics().frames_sent()),
      frames_dropped(session.visit().statistics().frames_dropped()),
      bytes_sent(session.visit().statistics().bytes_sent()),
      frames_in_flight(session.visit().flow().credit().in_flight()),
      credit(session.visit().flow().credit().limit()),
      base_rtt(session.visit().flow().credit().base_rtt()),
      queue_delay(session.visit().flow().queue_delay()),
      target_bitrate_kbps(session.visit().flow().bitrate_kbps()),
      steps_down(session.visit().flow().ladder().steps_down()),
      link(session.visit().flow().link()),
      usage(session.usage()) {
  if (const auto* visitor = session.audience().visitor())
    frames_queued = visitor->connection().queued_frames();
  const StreamControl& stream = session.visit().stream();
  if (stream.encoder_kind() == EncoderKind::x264) effort = stream.plan().effort();
}

void SessionReports::publish(const SessionList& sessions,
                             const std::vector<EncoderChoice>& encoders, Metrics& metrics) {
  auto reports = std::make_shared<std::vector<SessionReport>>();
  reports->reserve(sessions.size());
  std::size_t queued = 0;
  std::size_t spectators = 0;
  int in_flight = 0;
  int lost = 0;
  int stepped_down = 0;
  double target_bits_per_s = 0.0;
  std::map<EncoderKind, int> encoding;
  for (const auto& session : sessions) {
    const Visit& visit = session->visit();
    const SessionReport& report = reports->emplace_back(*session);
    if (visit.life().state() == VisitState::live && !visit.life().lost()) {
      stepped_down += report.steps_down > 0 ? 1 : 0;
      target_bits_per_s += 1e3 * report.target_bitrate_kbps;
      metrics.link_queue_seconds.Observe(std::chrono::duration<double>(report.queue_delay).count());
    }
    if (session->visitor().admitted_at) ++encoding[session->visitor().encoder.kind];
    queued += report.frames_queued;
    lost += visit.life().lost() ? 1 : 0;
    spectators += report.spectators;
    in_flight += report.frames_in_flight;
  }
  for (const EncoderChoice& encoder : encoders)
    metrics.set_encoder_sessions(std::string(encoder_name(encoder.kind)), encoding[encoder.kind]);
  metrics.sessions_lost.Set(lost);
  metrics.spectators.Set(static_cast<double>(spectators));
  metrics.sessions_stepped_down.Set(stepped_down);
  metrics.target_bits_per_second.Set(target_bits_per_s);
  metrics.frames_queued.Set(static_cast<double>(queued));
  metrics.frames_in_flight.Set(in_flight);
  const std::lock_guard lock(mutex_);
  published_ = std::move(reports);
}

std::string SessionReports::json() const {
  std::shared_ptr<const std::vector<SessionReport>> reports;
  {
    const std::lock_guard lock(mutex_);
    reports = published_;
  }
  auto sessions = nlohmann::json::array();
  for (const SessionReport& report : *reports) sessions.push_back(report_json(report));
  return sessions.dump();
}

}  // namespace catgs

#include "server/session/session_report.h"

#include <string_view>

#include <nlohmann/json.hpp>

namespace catgs {
namespace {

std::string_view state_name(const Session& session) {
  if (session.lost()) return "lost";
  switch (session.state()) {
    case Session::State::awaiting_hello:
      return "awaiting_hello";
    case Session::State::queued:
      return "queued";
    case Session::State::opening:
      return "opening";
    case Session::State::live:
      return "live";
    case Session::State::closed:
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
  const EffortPreset& preset = effort_presets[static_cast<std::size_t>(report.effort.preset)];
  const bool x264 = report.encoder == EncoderKind::x264;
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
      {"preset", x264 ? json(preset.name) : json()},
      {"encoder_threads", x264 ? json(report.effort.threads) : json()},
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

SessionReport::SessionReport(const Client& client)
    : id(client.session().id()),
      state(state_name(client.session())),
      paused(client.session().paused()),
      spectators(client.spectators().size()),
      scene_id(client.session().scene() ? client.session().scene()->facts.scene_id : ""),
      config(client.session().config()),
      device(client.session().device()),
      encoder(client.session().encoder_kind()),
      effort(client.session().effort()),
      frames_sent(client.session().frames_sent()),
      frames_dropped(client.session().frames_dropped()),
      bytes_sent(client.session().bytes_sent()),
      frames_in_flight(client.session().flow().credit().in_flight()),
      credit(client.session().flow().credit().limit()),
      base_rtt(client.session().flow().credit().base_rtt()),
      queue_delay(client.session().flow().queue_delay()),
      target_bitrate_kbps(client.session().flow().bitrate_kbps()),
      steps_down(client.session().flow().steps_down()),
      link(client.session().flow().link()),
      frames_queued(client.queued_frames()),
      usage(client.usage()) {}

std::string to_json(const std::vector<SessionReport>& reports) {
  auto sessions = nlohmann::json::array();
  for (const SessionReport& report : reports) sessions.push_back(report_json(report));
  return sessions.dump();
}

}  // namespace catgs

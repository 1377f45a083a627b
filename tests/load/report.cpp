#include "tests/load/report.h"

#include <algorithm>
#include <iterator>
#include <limits>
#include <map>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace catgs::load {
namespace {

using Json = nlohmann::ordered_json;

struct NamedHistogram {
  const char* name;
  const char* meaning;
  DurationHistogram SessionStats::*member;
};

constexpr NamedHistogram histograms[] = {
    {"pose_to_frame", "pose sent -> frame received", &SessionStats::pose_to_frame},
    {"pose_age", "age of the picture at each tick", &SessionStats::pose_age},
    {"frame_interval", "between frames", &SessionStats::frame_interval},
    {"wait", "server: pose received -> render", &SessionStats::wait},
    {"render", "server: render", &SessionStats::render},
    {"encode", "server: encode", &SessionStats::encode},
    {"send", "server: encoded -> socket", &SessionStats::send},
    {"decode", "client: decode", &SessionStats::decode}};

struct NamedCount {
  const char* name;
  std::uint64_t SessionStats::*member;
};

constexpr NamedCount counts[] = {{"frames", &SessionStats::frames},
                                 {"bytes", &SessionStats::bytes},
                                 {"idrs", &SessionStats::idrs},
                                 {"repeated_poses", &SessionStats::repeated_poses},
                                 {"poses_sent", &SessionStats::poses_sent},
                                 {"errors", &SessionStats::errors},
                                 {"decode_errors", &SessionStats::decode_errors},
                                 {"frames_skipped", &SessionStats::frames_skipped},
                                 {"reconnects", &SessionStats::reconnects}};

struct Range {
  double min = std::numeric_limits<double>::infinity(), mean = 0.0, max = 0.0;
};

template <typename Value>
Range range_of(const SessionReports& sessions, Value value) {
  Range range;
  for (const auto& session : sessions) {
    const double v = value(session->stats);
    range.min = std::min(range.min, v);
    range.max = std::max(range.max, v);
    range.mean += v / static_cast<double>(sessions.size());
  }
  if (sessions.empty()) range.min = 0.0;
  return range;
}

double value_of(const Metrics& metrics, const std::string& name) {
  return std::ranges::find_if(metrics, [&](const auto& m) { return m.first == name; })->second;
}

std::map<std::string, std::uint64_t> all_errors(const SessionReports& sessions) {
  std::map<std::string, std::uint64_t> errors;
  for (const auto& session : sessions) {
    for (const auto& [what, count] : session->stats.error_counts) errors[what] += count;
  }
  return errors;
}

/// Of the first session that was admitted.
const SessionReport* admitted(const SessionReports& sessions) {
  const auto found =
      std::ranges::find_if(sessions, [](const auto& session) { return session->stats.connected; });
  return found == sessions.end() ? nullptr : found->get();
}

}  // namespace

Metrics collect_metrics(const SessionReports& sessions, double nominal_fps) {
  Metrics metrics;
  const auto add = [&](const std::string& name, double value) {
    metrics.emplace_back(name, value);
  };
  add("sessions", static_cast<double>(sessions.size()));
  add("sessions_connected", static_cast<double>(std::ranges::count_if(
                                sessions, [](const auto& s) { return s->stats.connected; })));
  for (const NamedHistogram& histogram : histograms) {
    DurationHistogram all;
    for (const auto& session : sessions) all.add(session->stats.*histogram.member);
    add(fmt::format("{}_mean_ms", histogram.name), all.mean_ms());
    add(fmt::format("{}_p50_ms", histogram.name), all.percentile_ms(0.50));
    add(fmt::format("{}_p95_ms", histogram.name), all.percentile_ms(0.95));
    add(fmt::format("{}_p99_ms", histogram.name), all.percentile_ms(0.99));
    add(fmt::format("{}_max_ms", histogram.name), all.max_ms());
  }
  const Range fps = range_of(sessions, [](const SessionStats& stats) { return stats.fps(); });
  add("fps_min", fps.min);
  add("fps_mean", fps.mean);
  add("fps_max", fps.max);
  add("fps_min_percent", 100.0 * fps.min / nominal_fps);
  const Range bitrate =
      range_of(sessions, [](const SessionStats& stats) { return stats.bitrate_kbps(); });
  add("bitrate_kbps_min", bitrate.min);
  add("bitrate_kbps_mean", bitrate.mean);
  add("bitrate_kbps_max", bitrate.max);
  for (const NamedCount& count : counts) {
    double sum = 0.0;
    for (const auto& session : sessions) {
      sum += static_cast<double>(session->stats.*count.member);
    }
    add(count.name, sum);
  }
  return metrics;
}

Json to_json(const SessionReports& sessions, const Metrics& metrics) {
  Json json;
  if (const SessionReport* first = admitted(sessions)) {
    json["server"] = {{"version", first->server_version},
                      {"renderer", first->renderer},
                      {"encoder", first->encoder}};
  }
  for (const auto& [name, value] : metrics) json["metrics"][name] = value;
  json["error_counts"] = all_errors(sessions);
  for (const auto& session : sessions) {
    const SessionStats& stats = session->stats;
    Json one = {{"connected", stats.connected},
                {"measured_s", stats.measured_s()},
                {"fps", stats.fps()},
                {"bitrate_kbps", stats.bitrate_kbps()},
                {"pose_to_frame_p95_ms", stats.pose_to_frame.percentile_ms(0.95)},
                {"pose_age_p95_ms", stats.pose_age.percentile_ms(0.95)},
                {"frame_interval_p99_ms", stats.frame_interval.percentile_ms(0.99)}};
    for (const NamedCount& count : counts) one[count.name] = stats.*count.member;
    json["per_session"].push_back(std::move(one));
  }
  return json;
}

std::string to_table(const SessionReports& sessions, const Metrics& metrics) {
  std::string text;
  const auto out = std::back_inserter(text);
  const auto value = [&](const std::string& name) { return value_of(metrics, name); };
  if (const SessionReport* first = admitted(sessions)) {
    fmt::format_to(out, "renderer  {}\nencoder   {}\n", first->renderer, first->encoder);
  }
  fmt::format_to(out, "sessions  {:.0f} of {:.0f} connected, {:.0f} reconnects, {:.0f} errors\n",
                 value("sessions_connected"), value("sessions"), value("reconnects"),
                 value("errors"));
  fmt::format_to(out, "fps       {:.1f} min, {:.1f} mean, {:.1f} max; {:.0f} frames\n",
                 value("fps_min"), value("fps_mean"), value("fps_max"), value("frames"));
  fmt::format_to(out, "stream    {:.0f} kbit/s mean, {:.0f} IDR, {:.0f} decode errors\n\n",
                 value("bitrate_kbps_mean"), value("idrs"), value("decode_errors"));
  fmt::format_to(out, "{:<34}{:>9}{:>9}{:>9}{:>9}\n", "milliseconds", "p50", "p95", "p99", "max");
  for (const NamedHistogram& histogram : histograms) {
    const std::string name = histogram.name;
    if (value(name + "_max_ms") == 0.0) continue;  // not measured, as decoding without --decode
    fmt::format_to(out, "{:<34}{:9.1f}{:9.1f}{:9.1f}{:9.1f}\n", histogram.meaning,
                   value(name + "_p50_ms"), value(name + "_p95_ms"), value(name + "_p99_ms"),
                   value(name + "_max_ms"));
  }
  for (const auto& [what, count] : all_errors(sessions)) {
    fmt::format_to(out, "\n{} x {}", count, what);
  }
  if (value("errors") > 0.0) text += '\n';
  return text;
}

}  // namespace catgs::load

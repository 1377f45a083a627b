#include "tests/load/report.h"

#include <algorithm>
#include <iterator>
#include <map>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace catgs::load {
namespace {

using Json = nlohmann::ordered_json;

std::map<std::string, std::uint64_t> all_errors(const SessionReports& sessions) {
  std::map<std::string, std::uint64_t> errors;
  for (const auto& session : sessions) {
    for (const auto& [what, count] : session->stats.error_counts) errors[what] += count;
  }
  return errors;
}

Json display_json(const std::vector<JudgedRefresh>& judged) {
  Json json;
  for (const JudgedRefresh& refresh : judged) {
    json["at_s"].push_back(refresh.at_s);
    json["ssim"].push_back(refresh.ssim);
    json["psnr_db"].push_back(refresh.psnr_db);
    json["uncovered"].push_back(refresh.uncovered);
    json["age_ms"].push_back(refresh.age_ms);
    json["rest"].push_back(refresh.rest);
    json["sampled"].push_back(refresh.sampled);
  }
  return json;
}

Json session_json(const SessionReport& session, double nominal_fps, const HoldBounds& bounds) {
  const SessionStats& stats = session.stats;
  Json json = {{"connected", stats.connected},
               {"held", holds(session, nominal_fps, bounds)},
               {"measured_s", stats.measured_s()},
               {"fps", stats.fps()},
               {"bitrate_kbps", stats.bitrate_kbps()},
               {"pose_to_frame_p95_ms", stats.durations.pose_to_frame.percentile_ms(0.95)},
               {"pose_age_p95_ms", stats.durations.pose_age.percentile_ms(0.95)},
               {"frame_interval_p99_ms", stats.durations.frame_interval.percentile_ms(0.99)},
               {"psnr_db", mean_psnr_db(session)}};
  if (session.display) json["display"] = display_json(session.judged);
  for (const NamedCount& count : named_counts()) json[count.name] = stats.counts.*count.member;
  return json;
}

Json series_json(const GroupReport& group) {
  Json json = {{"bin_s", group.series->bin_s()}};
  for (const SeriesBin& bin : group.series->bins()) {
    json["frames"].push_back(bin.frames);
    json["bytes"].push_back(bin.bytes);
    json["sessions"].push_back(bin.sessions);
    json["pose_to_frame_p95_ms"].push_back(bin.pose_to_frame.percentile_ms(0.95));
    json["pose_age_p95_ms"].push_back(bin.pose_age.percentile_ms(0.95));
  }
  return json;
}

void append_table(const GroupReport& group, const HoldBounds& bounds, std::string& text) {
  const auto out = std::back_inserter(text);
  const SessionReports& sessions = group.sessions;
  const Metrics metrics = collect_metrics(sessions, group.nominal_fps, bounds);
  const auto value = [&](const std::string& name) { return value_of(metrics, name); };
  if (const SessionReport* first = admitted(sessions))
    fmt::format_to(out, "renderer  {}\nencoder   {}\n", first->renderer, first->encoder);
  fmt::format_to(out, "sessions  {:.0f} of {:.0f} connected, {:.0f} reconnects, {:.0f} errors\n",
                 value("sessions_connected"), value("sessions"), value("reconnects"),
                 value("errors"));
  fmt::format_to(out, "fps       {:.1f} min, {:.1f} mean, {:.1f} max; {:.0f} frames\n",
                 value("fps_min"), value("fps_mean"), value("fps_max"), value("frames"));
  fmt::format_to(out, "stream    {:.0f} kbit/s mean, {:.0f} IDR, {:.0f} decode errors\n",
                 value("bitrate_kbps_mean"), value("idrs"), value("decode_errors"));
  if (value("pictures") > 0.0) {
    fmt::format_to(out, "pictures  {:.1f} dB mean, {:.1f} min of {:.0f}; {:.0f} sessions held\n",
                   value("psnr_mean_db"), value("psnr_min_db"), value("pictures"),
                   value("sessions_held"));
  }
  fmt::format_to(out, "\n{:<34}{:>9}{:>9}{:>9}{:>9}\n", "milliseconds", "p50", "p95", "p99", "max");
  for (const NamedHistogram& histogram : named_histograms()) {
    const std::string name = histogram.name;
    if (value(name + "_max_ms") == 0.0) continue;  // not measured, as decoding without --decode
    fmt::format_to(out, "{:<34}{:9.1f}{:9.1f}{:9.1f}{:9.1f}\n", histogram.meaning,
                   value(name + "_p50_ms"), value(name + "_p95_ms"), value(name + "_p99_ms"),
                   value(name + "_max_ms"));
  }
  for (const auto& [what, count] : all_errors(sessions))
    fmt::format_to(out, "\n{} x {}", count, what);
  if (value("errors") > 0.0) text += '\n';
}

}  // namespace

const SessionReport* admitted(const SessionReports& sessions) {
  const auto found =
      std::ranges::find_if(sessions, [](const auto& session) { return session->stats.connected; });
  return found == sessions.end() ? nullptr : found->get();
}

Json to_json(const RunReport& report, const Metrics& metrics, const HoldBounds& bounds) {
  Json json;
  for (const GroupReport& group : report.groups) {
    const SessionReport* first = admitted(group.sessions);
    if (first == nullptr || json.contains("server")) continue;
    json["server"] = {{"version", first->server_version},
                      {"renderer", first->renderer},
                      {"encoder", first->encoder}};
  }
  for (const auto& [name, value] : metrics) json["metrics"][name] = value;
  json["held_means"] = {{"pose_to_frame_p95_ms", bounds.pose_to_frame_p95_ms},
                        {"pose_age_p95_ms", bounds.pose_age_p95_ms},
                        {"psnr_db", bounds.psnr_db}};
  for (const GroupReport& group : report.groups) {
    Json one = {{"name", group.name},
                {"nominal_fps", group.nominal_fps},
                {"error_counts", all_errors(group.sessions)},
                {"series", series_json(group)}};
    for (const auto& session : group.sessions)
      one["per_session"].push_back(session_json(*session, group.nominal_fps, bounds));
    json["groups"].push_back(std::move(one));
  }
  return json;
}

PaperTable display_table(const RunReport& report, const HoldBounds& bounds) {
  struct Column {
    const char *title, *metric;
    int decimals;
  };
  constexpr Column columns[] = {{"SSIM mean", "display_ssim_mean", 3},
                                {"p5", "display_ssim_p5", 3},
                                {"min", "display_ssim_min", 3},
                                {"PSNR dB mean", "display_psnr_mean_db", 1},
                                {"p5", "display_psnr_p5_db", 1},
                                {"min", "display_psnr_min_db", 1},
                                {"uncovered %", "display_uncovered_percent", 2},
                                {"pose age ms p50", "display_age_p50_ms", 0},
                                {"p95", "display_age_p95_ms", 0},
                                {"freezes", "display_freezes", 0},
                                {"longest ms", "display_freeze_max_ms", 0},
                                {"40 dB after rest ms", "display_40db_after_rest_max_ms", 0},
                                {"frames/s", "fps_mean", 1},
                                {"kbit/s", "bitrate_kbps_mean", 0}};
  PaperTable table{.corner = "clients"};
  for (const Column& column : columns) table.columns.emplace_back(column.title);
  for (const GroupReport& group : report.groups) {
    const Metrics metrics = collect_metrics(group.sessions, group.nominal_fps, bounds);
    if (!(value_of(metrics, "display_refreshes") > 0.0)) continue;
    PaperTable::Row& row = table.rows.emplace_back(group.name);
    for (const Column& column : columns)
      row.numbers.push_back({value_of(metrics, column.metric), column.decimals});
  }
  table.notes = {"SSIM: luma, 11x11 Gaussian window. PSNR: RGB, at most 60 dB."};
  return table;
}

bool has_display(const GroupReport& group) {
  return std::ranges::any_of(group.sessions,
                             [](const auto& session) { return !session->judged.empty(); });
}

std::string to_table(const RunReport& report, const HoldBounds& bounds) {
  std::string text;
  if (const PaperTable displays = display_table(report, bounds); !displays.rows.empty()) {
    text = markdown(displays);
    for (const GroupReport& group : report.groups) {
      for (const auto& [what, count] : all_errors(group.sessions))
        text += fmt::format("{}: {} x {}\n", group.name, count, what);
    }
  }
  for (const GroupReport& group : report.groups) {
    if (has_display(group)) continue;  // it has a row above
    if (report.groups.size() > 1) text += fmt::format("\n-- {} --\n", group.name);
    append_table(group, bounds, text);
  }
  return text;
}

}  // namespace catgs::load

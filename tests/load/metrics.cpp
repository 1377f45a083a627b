#include "tests/load/metrics.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <numeric>
#include <ranges>

#include <fmt/format.h>

#include "render_core/base/error.h"
#include "render_core/metrics/image_quality.h"
#include "render_core/metrics/summary.h"
#include "tests/load/options.h"
#include "tests/load/units.h"

namespace catgs::load {
namespace {

constexpr NamedHistogram histograms[] = {
    {"admission", "hello -> welcome", &Durations::admission},
    {"pose_to_frame", "pose sent -> frame received", &Durations::pose_to_frame},
    {"pose_age", "age of the picture at each tick", &Durations::pose_age},
    {"frame_interval", "between frames", &Durations::frame_interval},
    {"recovery", "interruption -> next frame", &Durations::recovery},
    {"wait", "server: pose received -> render", &Durations::wait},
    {"render", "server: render", &Durations::render},
    {"encode", "server: encode", &Durations::encode},
    {"send", "server: encoded -> socket", &Durations::send},
    {"decode", "client: decode", &Durations::decode}};

constexpr NamedCount counts[] = {{"frames", &Counts::frames},
                                 {"bytes", &Counts::bytes},
                                 {"idrs", &Counts::idrs},
                                 {"repeated_poses", &Counts::repeated_poses},
                                 {"poses_sent", &Counts::poses_sent},
                                 {"errors", &Counts::errors},
                                 {"decode_errors", &Counts::decode_errors},
                                 {"frames_skipped", &Counts::frames_skipped},
                                 {"reconnects", &Counts::reconnects},
                                 {"leaves", &Counts::leaves},
                                 {"decoders_lost", &Counts::decoders_lost}};

// A picture at rest with this much, of chroma at half the size too, is one that stays.
constexpr double sharp_db = 38.0;
constexpr double shown_sharp_db = 40.0;

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

double squared_error(double psnr_db) { return std::pow(10.0, -0.1 * psnr_db); }

void add_durations(const std::string& name, const DurationHistogram& histogram, Metrics& metrics) {
  metrics.emplace_back(name + "_mean_ms", histogram.mean_ms());
  metrics.emplace_back(name + "_p50_ms", histogram.percentile_ms(0.50));
  metrics.emplace_back(name + "_p95_ms", histogram.percentile_ms(0.95));
  metrics.emplace_back(name + "_p99_ms", histogram.percentile_ms(0.99));
  metrics.emplace_back(name + "_max_ms", histogram.max_ms());
}

void add_pictures(const SessionReports& sessions, Metrics& metrics) {
  double sum = 0.0, count = 0.0, min = std::numeric_limits<double>::infinity();
  for (const auto& session : sessions) {
    for (const PictureSample& sample : session->pictures) {
      if (sample.rest > 0) continue;
      sum += squared_error(sample.psnr_db);
      min = std::min(min, sample.psnr_db);
      ++count;
    }
  }
  const double none = std::nan("");
  metrics.emplace_back("pictures", count);
  metrics.emplace_back("psnr_mean_db", count > 0.0 ? psnr_db(sum / count) : none);
  metrics.emplace_back("psnr_min_db", count > 0.0 ? min : none);
}

/// Time from the start of a rest to a sharp picture of the wanted size.
double sharp_after_ms(const SessionReport& session, int rest) {
  for (const PictureSample& sample : session.pictures)
    if (sample.rest == rest && sample.picture.size_px == session.still_size_px &&
        sample.psnr_db >= sharp_db)
      return 1e-3 * static_cast<double>(sample.after_us);
  return std::numeric_limits<double>::infinity();
}

void add_rests(const SessionReports& sessions, Metrics& metrics) {
  std::vector<double> times_ms;
  double worst_db = std::numeric_limits<double>::infinity();
  for (const auto& session : sessions) {
    for (int rest = 1; rest <= std::min(session->rests, max_rests); ++rest) {
      times_ms.push_back(sharp_after_ms(*session, rest));
      double best_db = 0.0;
      for (const PictureSample& sample : session->pictures)
        if (sample.rest == rest) best_db = std::max(best_db, sample.psnr_db);
      worst_db = std::min(worst_db, best_db);
    }
  }
  std::ranges::sort(times_ms);
  const bool none = times_ms.empty();
  metrics.emplace_back("rests", static_cast<double>(times_ms.size()));
  metrics.emplace_back("sharp_after_rest_p50_ms",
                       none ? std::nan("") : times_ms[times_ms.size() / 2]);
  metrics.emplace_back("sharp_after_rest_max_ms", none ? std::nan("") : times_ms.back());
  metrics.emplace_back("still_psnr_min_db", none ? std::nan("") : worst_db);
}

/// The least value that `share` of the sorted ones do not exceed, 0 for the first; NaN for none.
double quantile(const std::vector<double>& sorted, double share) {
  if (sorted.empty()) return std::nan("");
  return share > 0.0 ? percentile(sorted, share) : sorted.front();
}

/// From the start of a rest to the refresh from which pictures stay sharp until its end.
double shown_sharp_after_ms(const SessionReport& session, int rest) {
  double after_ms = std::numeric_limits<double>::infinity();
  for (const JudgedRefresh& refresh : std::views::reverse(session.judged)) {
    if (refresh.rest != rest) continue;
    if (refresh.psnr_db < shown_sharp_db) break;
    after_ms = 1e-3 * static_cast<double>(refresh.after_us);
  }
  return after_ms;
}

/// Metrics of what the visitors saw, with --glass.
void add_displays(const SessionReports& sessions, Metrics& metrics) {
  std::vector<double> ssim, psnr_db, uncovered, ages_ms, freezes, sharp_ms;
  for (const auto& session : sessions) {
    if (!session->display) continue;
    for (const JudgedRefresh& refresh : session->judged) {
      if (!refresh.sampled) continue;
      ssim.push_back(refresh.ssim);
      psnr_db.push_back(refresh.psnr_db);
      uncovered.push_back(100.0 * refresh.uncovered);
    }
    for (int rest = 1; rest <= session->rests; ++rest)
      sharp_ms.push_back(shown_sharp_after_ms(*session, rest));
    std::ranges::copy_if(pose_ages_ms(*session->display), std::back_inserter(ages_ms),
                         [](double age_ms) { return !std::isnan(age_ms); });
    std::ranges::copy(freezes_ms(*session->display), std::back_inserter(freezes));
  }
  for (std::vector<double>* values : {&ssim, &psnr_db, &ages_ms, &freezes, &sharp_ms})
    std::ranges::sort(*values);
  const auto sum = [](const std::vector<double>& v) {
    return std::accumulate(v.begin(), v.end(), 0.0);
  };
  const auto mean = [&](const std::vector<double>& v) {
    return v.empty() ? std::nan("") : sum(v) / static_cast<double>(v.size());
  };
  metrics.insert(metrics.end(), {{"display_refreshes", static_cast<double>(ssim.size())},
                                 {"display_ssim_mean", mean(ssim)},
                                 {"display_ssim_p5", quantile(ssim, 0.05)},
                                 {"display_ssim_min", quantile(ssim, 0.0)},
                                 {"display_psnr_mean_db", mean(psnr_db)},
                                 {"display_psnr_p5_db", quantile(psnr_db, 0.05)},
                                 {"display_psnr_min_db", quantile(psnr_db, 0.0)},
                                 {"display_uncovered_percent", mean(uncovered)},
                                 {"display_age_p50_ms", quantile(ages_ms, 0.5)},
                                 {"display_age_p95_ms", quantile(ages_ms, 0.95)},
                                 {"display_age_max_ms", quantile(ages_ms, 1.0)},
                                 {"display_freezes", static_cast<double>(freezes.size())},
                                 {"display_frozen_ms", sum(freezes)},
                                 {"display_freeze_max_ms", freezes.empty() ? 0.0 : freezes.back()},
                                 {"display_40db_after_rest_p50_ms", quantile(sharp_ms, 0.5)},
                                 {"display_40db_after_rest_max_ms", quantile(sharp_ms, 1.0)}});
}

Metrics window_metrics(const SeriesBin& bin, double bin_s, std::size_t sessions) {
  Metrics metrics;
  add_durations("pose_to_frame", bin.pose_to_frame, metrics);
  add_durations("pose_age", bin.pose_age, metrics);
  const double session_s = bin_s * static_cast<double>(std::max<std::size_t>(sessions, 1));
  metrics.emplace_back("fps_mean", static_cast<double>(bin.frames) / session_s);
  metrics.emplace_back("bitrate_kbps_mean", 8e-3 * static_cast<double>(bin.bytes) / session_s);
  const auto frames = static_cast<double>(std::max<std::uint64_t>(bin.frames, 1));
  metrics.emplace_back("megapixels_mean", 1e-6 * static_cast<double>(bin.pixels) / frames);
  return metrics;
}

}  // namespace

std::span<const NamedHistogram> named_histograms() { return histograms; }
std::span<const NamedCount> named_counts() { return counts; }

double value_of(const Metrics& metrics, std::string_view name) {
  const auto found = std::ranges::find_if(metrics, [&](const auto& m) { return m.first == name; });
  return found == metrics.end() ? std::nan("") : found->second;
}

DurationHistogram merged(const SessionReports& sessions, DurationHistogram Durations::*member) {
  DurationHistogram all;
  for (const auto& session : sessions) all.add(session->stats.durations.*member);
  return all;
}

double mean_psnr_db(const SessionReport& session) {
  if (session.pictures.empty()) return std::nan("");
  double sum = 0.0, count = 0.0;
  for (const PictureSample& sample : session.pictures) {
    if (sample.rest > 0) continue;
    sum += squared_error(sample.psnr_db);
    ++count;
  }
  return count > 0.0 ? psnr_db(sum / count) : std::nan("");
}

bool holds(const SessionReport& session, double nominal_fps, const HoldBounds& bounds) {
  const SessionStats& stats = session.stats;
  return stats.fps() >= 0.95 * nominal_fps &&
         stats.durations.frame_interval.percentile_ms(0.99) <= 2e3 / nominal_fps &&
         stats.durations.pose_to_frame.percentile_ms(0.95) <= bounds.pose_to_frame_p95_ms &&
         stats.durations.pose_age.percentile_ms(0.95) <= bounds.pose_age_p95_ms &&
         mean_psnr_db(session) >= bounds.psnr_db;
}

Metrics collect_metrics(const SessionReports& sessions, double nominal_fps,
                        const HoldBounds& bounds) {
  Metrics metrics;
  const auto add = [&](const std::string& name, double value) {
    metrics.emplace_back(name, value);
  };
  const auto count_if = [&](auto condition) {
    return static_cast<double>(
        std::ranges::count_if(sessions, [&](const auto& s) { return condition(*s); }));
  };
  const double held = count_if([&](const auto& s) { return holds(s, nominal_fps, bounds); });
  add("sessions", static_cast<double>(sessions.size()));
  add("sessions_connected", count_if([](const auto& s) { return s.stats.connected; }));
  add("sessions_held", held);
  add("held", held == static_cast<double>(sessions.size()) ? 1.0 : 0.0);
  for (const NamedHistogram& histogram : histograms)
    add_durations(histogram.name, merged(sessions, histogram.member), metrics);
  const Range fps = range_of(sessions, [](const SessionStats& stats) { return stats.fps(); });
  add("fps_min", fps.min);
  add("fps_mean", fps.mean);
  add("fps_max", fps.max);
  add("fps_min_percent", 100.0 * fps.min / nominal_fps);
  add("fps_max_over_min", fps.max / fps.min);
  const Range bitrate =
      range_of(sessions, [](const SessionStats& stats) { return stats.bitrate_kbps(); });
  add("bitrate_kbps_min", bitrate.min);
  add("bitrate_kbps_mean", bitrate.mean);
  add("bitrate_kbps_max", bitrate.max);
  add_pictures(sessions, metrics);
  add_rests(sessions, metrics);
  add_displays(sessions, metrics);
  for (const NamedCount& count : counts) {
    double sum = 0.0;
    for (const auto& session : sessions)
      sum += static_cast<double>(session->stats.counts.*count.member);
    add(count.name, sum);
  }
  return metrics;
}

bool is_window_metric(std::string_view name) { return name.find('@') != std::string_view::npos; }

double window_metric(const RunReport& report, std::string_view name) {
  const auto refuse = [&](std::string_view what, std::string_view remedy) {
    throw InputError("--require", name, what, remedy);
  };
  const std::size_t at = std::min(name.find('@'), name.size());
  const std::string_view window = name.substr(std::min(at + 1, name.size()));
  const std::size_t dash = window.find('-');
  if (dash == std::string_view::npos) refuse("is not a part of the run", "like fps_mean@5s-10s");
  const double from_s = parse_duration_s("--require", window.substr(0, dash));
  const double to_s = parse_duration_s("--require", window.substr(dash + 1));
  if (!(from_s < to_s)) refuse("is not a part of the run", "FROM-TO, in seconds of the run");
  const std::size_t dot = name.substr(0, at).rfind('.');
  const std::string_view group = dot == std::string_view::npos ? "" : name.substr(0, dot);
  const std::string_view metric =
      dot == std::string_view::npos ? name.substr(0, at) : name.substr(dot + 1, at - dot - 1);
  SeriesBin sum;
  std::size_t sessions = 0;
  bool known = false;
  for (const GroupReport& one : report.groups) {
    if (!group.empty() && one.name != group) continue;
    known = true;
    sum.add(one.series->sum(from_s, to_s));
    sessions += one.sessions.size();
  }
  if (!known) refuse(fmt::format("there are no clients \"{}\"", group), "");
  const Metrics metrics = window_metrics(sum, to_s - from_s, sessions);
  std::string names;
  for (const auto& [known_name, value] : metrics) {
    if (known_name == metric) return value;
    names += (names.empty() ? "" : ", ") + known_name;
  }
  throw InputError("--require", name, "is not known of a part of the run", "one of " + names);
}

Metrics collect_metrics(const RunReport& report, const HoldBounds& bounds) {
  Metrics all;
  for (const GroupReport& group : report.groups) {
    const std::string prefix = group.name == unnamed_group ? "" : group.name + ".";
    for (auto& [name, value] : collect_metrics(group.sessions, group.nominal_fps, bounds))
      all.emplace_back(prefix + name, value);
  }
  return all;
}

}  // namespace catgs::load

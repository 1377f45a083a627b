#pragma once

#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "tests/load/run_report.h"

namespace catgs::load {

/// Named results of a run, in the order of the report.
using Metrics = std::vector<std::pair<std::string, double>>;

/// When a session holds its nominal rate: it delivers 95 % of its frames, one interval in a hundred
/// at most is longer than two nominal ones, and these three. Its ladder should be off, or the rate
/// is held by a smaller picture.
struct HoldBounds {
  double pose_to_frame_p95_ms = 33.0;
  double pose_age_p95_ms = 50.0;
  double psnr_db = 32.0;  // of the decoded pictures against the renderer; unchecked is not held
};

bool holds(const SessionReport& session, double nominal_fps, const HoldBounds& bounds);

/// Every named result: what --require may bound and what JSON and table show. Durations are over
/// the frames, poses or ticks of all sessions; rates are per session. Those of a group with a name
/// are called GROUP.METRIC.
Metrics collect_metrics(const RunReport& report, const HoldBounds& bounds);
Metrics collect_metrics(const SessionReports& sessions, double nominal_fps,
                        const HoldBounds& bounds);

/// METRIC@FROM-TO, like "good.pose_to_frame_p95_ms@12s-20s", is the metric in a part of the run.
/// Throws InputError if there is no such metric or group.
bool is_window_metric(std::string_view name);
double window_metric(const RunReport& report, std::string_view name);

double value_of(const Metrics& metrics, std::string_view name);

struct NamedHistogram {
  const char* name;
  const char* meaning;
  DurationHistogram Durations::*member;
};
std::span<const NamedHistogram> named_histograms();

struct NamedCount {
  const char* name;
  std::uint64_t Counts::*member;
};
std::span<const NamedCount> named_counts();

DurationHistogram merged(const SessionReports& sessions, DurationHistogram Durations::*member);

/// PSNR of the mean squared error of a session's checked pictures; NaN without any.
double mean_psnr_db(const SessionReport& session);

}  // namespace catgs::load

#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "tests/load/metrics.h"

namespace catgs::load {

/// What a scrape of /metrics said. Series are named by their family, without "catgs_", and the
/// values of their labels: catgs_frame_stage_seconds{stage="send"} is "frame_stage_send".
struct PrometheusSnapshot {
  struct Histogram {
    std::map<double, double> cumulative;  // by upper bound, seconds
    double sum = 0.0;
  };
  std::map<std::string, Histogram> histograms;  // families in seconds
  std::map<std::string, double> values;         // counters and gauges
};

PrometheusSnapshot parse_prometheus(std::string_view text);

/// What happened between two scrapes: p50, p95, p99 and mean of histograms (interpolated within
/// their buckets) in milliseconds, increase of counters ("…_total"), last value of gauges. Names
/// begin with `prefix`.
Metrics change_between(const PrometheusSnapshot& before, const PrometheusSnapshot& after,
                       const std::string& prefix);

}  // namespace catgs::load

#pragma once

#include <string>

#include <nlohmann/json_fwd.hpp>

#include "tests/load/metrics.h"

namespace catgs::load {

/// The changes between two answers of /api/metrics: p50, p95, p99 and mean of histograms
/// (interpolated within their buckets) in milliseconds, increase of counters ("…_total"), last
/// value of gauges. A name is `prefix`, the family without "catgs_", and the values of the labels:
/// catgs_frame_stage_seconds{stage="send"} becomes "frame_stage_send_p50_ms" and so on.
Metrics change_between(const nlohmann::ordered_json& before, const nlohmann::ordered_json& after,
                       const std::string& prefix);

}  // namespace catgs::load

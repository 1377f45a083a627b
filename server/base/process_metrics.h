#pragma once

#include <vector>

#include <prometheus/metric_family.h>

namespace catgs {

/// Returns metrics of this process under the standard names of Prometheus's client libraries:
/// process_cpu_seconds_total, process_resident_memory_bytes, process_open_fds, process_max_fds,
/// process_start_time_seconds. Unreadable values are left out.
std::vector<prometheus::MetricFamily> process_metrics();

}  // namespace catgs

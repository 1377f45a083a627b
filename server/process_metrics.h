#pragma once

#include <vector>

#include <prometheus/metric_family.h>

namespace catgs {

/// What the system says of this process, under the names that Prometheus's own client libraries
/// use: process_cpu_seconds_total, process_resident_memory_bytes, process_open_fds,
/// process_max_fds, process_start_time_seconds. What cannot be read is left out.
std::vector<prometheus::MetricFamily> process_metrics();

}  // namespace catgs

#pragma once

#include <vector>

#include <prometheus/metric_family.h>

namespace catgs {

/// Returns metrics of this process under the standard names of Prometheus's client libraries:
/// process_cpu_seconds_total, process_resident_memory_bytes, process_open_fds, process_max_fds,
/// process_start_time_seconds. process_heap_bytes is ours: what glibc's malloc has given out, so
/// that a leak can be told from a fragmented heap. Unreadable values are left out.
std::vector<prometheus::MetricFamily> process_metrics();

}  // namespace catgs

#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace catgs {

/// A set of measured values in five numbers. All are 0 for an empty set.
struct Summary {
  std::size_t count = 0;
  double mean = 0.0;
  double p50 = 0.0;
  double p95 = 0.0;
  double p99 = 0.0;
  double max = 0.0;
};

/// The smallest value that at least `share` (0…1] of the values do not exceed (nearest rank); 0 for
/// an empty set. `sorted` is in increasing order.
double percentile(std::span<const double> sorted, double share);

Summary summarize(std::vector<double> values);

/// How even the frame times of a moving camera are: the p99 over frames of t_i / median(t_{i-60} …
/// t_{i+60}), the window cut at the ends. The cost of a frame changes along a trace, so p99 / mean
/// would measure the trace. 0 for an empty set.
double flatness(std::span<const double> frame_ms);

}  // namespace catgs

#include "render_core/metrics/summary.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <numeric>

namespace catgs {

double percentile(std::span<const double> sorted, double share) {
  assert(share > 0.0 && share <= 1.0 && std::ranges::is_sorted(sorted));
  if (sorted.empty()) return 0.0;
  const double rank = std::ceil(share * static_cast<double>(sorted.size()));
  return sorted[static_cast<std::size_t>(
      std::clamp(rank - 1.0, 0.0, static_cast<double>(sorted.size() - 1)))];
}

Summary summarize(std::vector<double> values) {
  if (values.empty()) return {};
  std::ranges::sort(values);
  const double sum = std::accumulate(values.begin(), values.end(), 0.0);
  return {.count = values.size(),
          .mean = sum / static_cast<double>(values.size()),
          .p50 = percentile(values, 0.50),
          .p95 = percentile(values, 0.95),
          .p99 = percentile(values, 0.99),
          .max = values.back()};
}

double flatness(std::span<const double> frame_ms) {
  constexpr std::size_t reach = 60;
  std::vector<double> ratios;
  ratios.reserve(frame_ms.size());
  for (std::size_t i = 0; i < frame_ms.size(); ++i) {
    const std::size_t begin = i - std::min(i, reach);
    const std::size_t end = std::min(i + reach + 1, frame_ms.size());
    std::vector<double> window(frame_ms.begin() + begin, frame_ms.begin() + end);
    const auto middle = window.begin() + static_cast<std::ptrdiff_t>((window.size() - 1) / 2);
    std::ranges::nth_element(window, middle);
    ratios.push_back(frame_ms[i] / *middle);
  }
  return summarize(std::move(ratios)).p99;
}

}  // namespace catgs

#include "tests/load/server_metrics.h"

#include <cmath>
#include <limits>
#include <map>

#include <nlohmann/json.hpp>

namespace catgs::load {
namespace {

using ServerJson = nlohmann::ordered_json;
using Buckets = std::map<double, double>;  // upper bound in seconds, cumulative count

/// JSON has null for what is no finite number.
double finite_or(const ServerJson& json, double null_means) {
  return json.is_null() ? null_means : json.get<double>();
}

std::string series_name(std::string_view family, const ServerJson& series) {
  if (family.starts_with("catgs_")) family.remove_prefix(6);
  if (series.contains("buckets") && family.ends_with("_seconds")) family.remove_suffix(8);
  std::string name(family);
  for (const ServerJson& value : series.at("labels"))
    name.append("_").append(value.get<std::string>());
  return name;
}

/// The series of the same labels; null if there is none.
const ServerJson* find_series(const ServerJson& metrics, const std::string& family,
                              const ServerJson& labels) {
  if (!metrics.contains(family)) return nullptr;
  for (const ServerJson& series : metrics.at(family))
    if (series.at("labels") == labels) return &series;
  return nullptr;
}

void add(const ServerJson& series, double sign, Buckets& buckets) {
  for (const ServerJson& bucket : series.at("buckets")) {
    buckets[finite_or(bucket.at(0), std::numeric_limits<double>::infinity())] +=
        sign * bucket.at(1).get<double>();
  }
}

double percentile_ms(const Buckets& buckets, double share) {
  const double rank = share * buckets.rbegin()->second;
  double bound_below = 0.0, count_below = 0.0;
  for (const auto& [bound, count] : buckets) {
    if (count >= rank && count > count_below) {
      if (std::isinf(bound)) return 1e3 * bound;
      return 1e3 *
             (bound_below + (bound - bound_below) * (rank - count_below) / (count - count_below));
    }
    bound_below = bound;
    count_below = count;
  }
  return std::nan("");
}

void add_durations(const std::string& name, const ServerJson& series, const ServerJson* old,
                   Metrics& metrics) {
  Buckets buckets;
  add(series, 1.0, buckets);
  double sum_s = series.at("sum");
  if (old) {
    add(*old, -1.0, buckets);
    sum_s -= old->at("sum").get<double>();
  }
  metrics.emplace_back(name + "_mean_ms", 1e3 * sum_s / buckets.rbegin()->second);
  metrics.emplace_back(name + "_p50_ms", percentile_ms(buckets, 0.50));
  metrics.emplace_back(name + "_p95_ms", percentile_ms(buckets, 0.95));
  metrics.emplace_back(name + "_p99_ms", percentile_ms(buckets, 0.99));
}

}  // namespace

Metrics change_between(const ServerJson& before, const ServerJson& after,
                       const std::string& prefix) {
  Metrics metrics;
  for (const auto& [family, all] : after.items())
    for (const ServerJson& series : all) {
      const ServerJson* old = find_series(before, family, series.at("labels"));
      const std::string name = prefix + series_name(family, series);
      if (series.contains("buckets")) {
        add_durations(name, series, old, metrics);
      } else {
        const double value = finite_or(series.at("value"), std::nan(""));
        const bool counts = family.ends_with("_total") && old != nullptr;
        metrics.emplace_back(name, counts ? value - old->at("value").get<double>() : value);
      }
    }
  return metrics;
}

}  // namespace catgs::load

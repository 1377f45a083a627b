#include "tests/load/prometheus_text.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>

namespace catgs::load {
namespace {

struct Line {
  std::string family;
  std::string labels;  // their values, joined by _
  std::string le;      // of a bucket
  double value = 0.0;
};

double number(std::string_view text) {
  if (text == "+Inf") return std::numeric_limits<double>::infinity();
  double value = std::nan("");
  std::from_chars(text.data(), text.data() + text.size(), value);
  return value;
}

/// NAME{LABEL="VALUE",…} NUMBER
Line parse_line(std::string_view text) {
  Line line;
  const std::size_t space = text.rfind(' ');
  const std::size_t brace = std::min(text.find('{'), space);
  line.family = text.substr(0, brace);
  line.value = number(text.substr(space + 1));
  std::string_view labels = text.substr(brace, space - brace);
  while (true) {
    const std::size_t begin = labels.find("=\"");
    if (begin == std::string_view::npos) return line;
    const std::size_t end = labels.find('"', begin + 2);
    const std::string_view name = labels.substr(1, begin - 1);  // behind { or ,
    const std::string_view value = labels.substr(begin + 2, end - begin - 2);
    if (name == "le") {
      line.le = value;
    } else {
      line.labels.append(line.labels.empty() ? "" : "_").append(value);
    }
    labels.remove_prefix(std::min(end + 1, labels.size()));
  }
}

std::string series_name(std::string family, const std::string& labels) {
  if (family.starts_with("catgs_")) family.erase(0, 6);
  return labels.empty() ? family : family + "_" + labels;
}

/// Cuts `suffix` off; false where it is not there.
bool cut(std::string& text, std::string_view suffix) {
  if (!text.ends_with(suffix)) return false;
  text.resize(text.size() - suffix.size());
  return true;
}

double percentile_ms(const std::map<double, double>& cumulative, double share) {
  if (cumulative.empty() || cumulative.rbegin()->second <= 0.0) return std::nan("");
  const double rank = share * cumulative.rbegin()->second;
  double bound_below = 0.0, count_below = 0.0;
  for (const auto& [bound, count] : cumulative) {
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

}  // namespace

PrometheusSnapshot parse_prometheus(std::string_view text) {
  PrometheusSnapshot snapshot;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    const std::string_view raw = text.substr(0, end);
    text.remove_prefix(std::min(end + 1, text.size()));
    if (raw.empty() || raw.front() == '#') continue;
    Line line = parse_line(raw);
    if (!line.le.empty() && cut(line.family, "_seconds_bucket")) {
      snapshot.histograms[series_name(line.family, line.labels)].cumulative[number(line.le)] =
          line.value;
    } else if (cut(line.family, "_seconds_sum")) {
      snapshot.histograms[series_name(line.family, line.labels)].sum = line.value;
    } else if (!line.family.ends_with("_seconds_count")) {
      snapshot.values[series_name(line.family, line.labels)] = line.value;
    }
  }
  return snapshot;
}

Metrics change_between(const PrometheusSnapshot& before, const PrometheusSnapshot& after,
                       const std::string& prefix) {
  Metrics metrics;
  for (const auto& [name, histogram] : after.histograms) {
    PrometheusSnapshot::Histogram change = histogram;
    if (const auto old = before.histograms.find(name); old != before.histograms.end()) {
      for (auto& [bound, count] : change.cumulative) {
        if (old->second.cumulative.contains(bound)) count -= old->second.cumulative.at(bound);
      }
      change.sum -= old->second.sum;
    }
    const double count = change.cumulative.empty() ? 0.0 : change.cumulative.rbegin()->second;
    metrics.emplace_back(prefix + name + "_mean_ms",
                         count > 0.0 ? 1e3 * change.sum / count : std::nan(""));
    for (const auto& [suffix, share] :
         {std::pair{"_p50_ms", 0.50}, {"_p95_ms", 0.95}, {"_p99_ms", 0.99}}) {
      metrics.emplace_back(prefix + name + suffix, percentile_ms(change.cumulative, share));
    }
  }
  for (const auto& [name, value] : after.values) {
    const auto old = before.values.find(name);
    const bool counts = name.find("_total") != std::string::npos;
    metrics.emplace_back(prefix + name,
                         counts && old != before.values.end() ? value - old->second : value);
  }
  return metrics;
}

}  // namespace catgs::load

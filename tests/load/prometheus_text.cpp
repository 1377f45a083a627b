#include "tests/load/prometheus_text.h"

#include <charconv>
#include <cmath>
#include <limits>
#include <regex>
#include <sstream>

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
Line parse_line(const std::string& text) {
  static const std::regex form(R"(([^{ ]+)(?:\{(.*)\})? (\S+))");
  static const std::regex label(R"re((\w+)="([^"]*)")re");
  Line line;
  std::smatch parts;
  if (!std::regex_match(text, parts, form)) return line;
  line.family = parts[1];
  line.value = number(parts[3].str());
  const std::string labels = parts[2];
  for (std::sregex_iterator found(labels.begin(), labels.end(), label), end; found != end;
       ++found) {
    const std::string value = (*found)[2];
    if ((*found)[1] == "le") {
      line.le = value;
    } else {
      line.labels += (line.labels.empty() ? "" : "_") + value;
    }
  }
  return line;
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
  std::istringstream lines{std::string(text)};
  for (std::string raw; std::getline(lines, raw);) {
    if (raw.empty() || raw.starts_with('#')) continue;
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

#pragma once

#include <functional>
#include <string>
#include <string_view>

#include "tests/load/metrics.h"

namespace catgs::load {

/// A bound on one metric: METRIC OP NUMBER with OP of < <= > >= == !=, like
/// "pose_to_frame_p95_ms<33".
class Requirement {
 public:
  /// Throws InputError on bad grammar.
  explicit Requirement(std::string_view text);

  /// Throws InputError that lists the metrics when there is none of this name: to be called with an
  /// empty run's metrics first, so that a slip of the pen is found before the load, not after it.
  void check_name(const Metrics& metrics) const;
  [[nodiscard]] const std::string& metric() const { return metric_; }
  [[nodiscard]] const std::string& text() const { return text_; }
  [[nodiscard]] bool holds(const Metrics& metrics) const;
  /// NaN where it was not measured: then nothing holds but !=.
  [[nodiscard]] double value(const Metrics& metrics) const;
  /// "pose_to_frame_p95_ms<33: is 41.2".
  [[nodiscard]] std::string explain(const Metrics& metrics) const;

 private:
  using Comparison = std::function<bool(double, double)>;

  std::string text_;
  std::string metric_;
  Comparison compare_;
  double bound_ = 0.0;
};

}  // namespace catgs::load

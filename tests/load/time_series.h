#pragma once

#include <cstdint>
#include <vector>

#include "tests/load/histogram.h"

namespace catgs::load {

/// The measurements of a group of sessions in one span of the run.
struct SeriesBin {
  std::uint64_t frames = 0;
  std::uint64_t bytes = 0;
  std::uint64_t pixels = 0;    // of all frames
  std::uint32_t sessions = 0;  // that got a frame
  DurationHistogram pose_to_frame;
  DurationHistogram pose_age;

  void add(const SeriesBin& other);
};

/// A run second by second, in bounded memory: a longer run has wider bins. Pure.
class TimeSeries {
 public:
  /// Times are microseconds on one clock; the first bin begins at `begin_us`.
  explicit TimeSeries(std::int64_t begin_us) : begin_us_(begin_us) {}

  /// The bin that holds this time; earlier than the begin counts as that.
  SeriesBin& at(std::int64_t time_us);
  [[nodiscard]] bool same_bin(std::int64_t a_us, std::int64_t b_us) const {
    return (a_us - begin_us_) / bin_us_ == (b_us - begin_us_) / bin_us_;
  }

  [[nodiscard]] double bin_s() const { return 1e-6 * static_cast<double>(bin_us_); }
  [[nodiscard]] const std::vector<SeriesBin>& bins() const { return bins_; }
  /// The bins that begin in `from_s` … `to_s` (seconds since the begin) as one.
  [[nodiscard]] SeriesBin sum(double from_s, double to_s) const;

 private:
  static constexpr std::size_t max_bins = 600;
  std::int64_t begin_us_;
  std::int64_t bin_us_ = 1'000'000;
  std::vector<SeriesBin> bins_;
};

}  // namespace catgs::load

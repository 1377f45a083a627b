#include "tests/load/time_series.h"

#include <algorithm>
#include <utility>

namespace catgs::load {

void SeriesBin::add(const SeriesBin& other) {
  frames += other.frames;
  bytes += other.bytes;
  pixels += other.pixels;
  sessions = std::max(sessions, other.sessions);
  pose_to_frame.add(other.pose_to_frame);
  pose_age.add(other.pose_age);
}

SeriesBin& TimeSeries::at(std::int64_t time_us) {
  const std::int64_t since_us = std::max<std::int64_t>(time_us - begin_us_, 0);
  while (static_cast<std::size_t>(since_us / bin_us_) >= max_bins) {
    bin_us_ *= 2;
    std::vector<SeriesBin> wider((bins_.size() + 1) / 2);
    for (std::size_t i = 0; i < bins_.size(); ++i) wider[i / 2].add(bins_[i]);
    bins_ = std::move(wider);
  }
  const auto index = static_cast<std::size_t>(since_us / bin_us_);
  if (index >= bins_.size()) bins_.resize(index + 1);
  return bins_[index];
}

SeriesBin TimeSeries::sum(double from_s, double to_s) const {
  SeriesBin sum;
  for (std::size_t i = 0; i < bins_.size(); ++i) {
    const double begin_s = static_cast<double>(i) * bin_s();
    if (begin_s >= from_s && begin_s < to_s) sum.add(bins_[i]);
  }
  return sum;
}

}  // namespace catgs::load

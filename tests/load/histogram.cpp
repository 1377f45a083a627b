#include "tests/load/histogram.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

namespace catgs::load {

std::size_t DurationHistogram::bucket_of(std::int64_t duration_us) {
  const auto value = static_cast<std::uint64_t>(
      std::clamp<std::int64_t>(duration_us, 0, (std::int64_t{1} << max_bits) - 1));
  const int shift = std::max(0, static_cast<int>(std::bit_width(value)) - octave_bits - 1);
  return (static_cast<std::size_t>(shift) << octave_bits) + (value >> shift);
}

double DurationHistogram::middle_us(std::size_t bucket) {
  // Buckets up to 2 * 64 hold one value each; behind them bucket_of() is turned round.
  const std::size_t first_wide = std::size_t{2} << octave_bits;
  if (bucket < first_wide) return static_cast<double>(bucket);
  const std::size_t shift = (bucket >> octave_bits) - 1;
  const std::size_t mantissa = bucket - (shift << octave_bits);
  return (static_cast<double>(mantissa) + 0.5) * static_cast<double>(std::uint64_t{1} << shift);
}

void DurationHistogram::add(std::int64_t duration_us) {
  const std::int64_t value = std::max<std::int64_t>(duration_us, 0);
  ++counts_[bucket_of(value)];
  ++count_;
  max_us_ = std::max(max_us_, value);
  sum_us_ += static_cast<double>(value);
}

void DurationHistogram::add(const DurationHistogram& other) {
  for (std::size_t i = 0; i < buckets; ++i) counts_[i] += other.counts_[i];
  count_ += other.count_;
  max_us_ = std::max(max_us_, other.max_us_);
  sum_us_ += other.sum_us_;
}

double DurationHistogram::percentile_ms(double share) const {
  if (count_ == 0) return std::numeric_limits<double>::quiet_NaN();
  const auto rank =
      static_cast<std::uint64_t>(std::max(1.0, std::ceil(share * static_cast<double>(count_))));
  std::uint64_t seen = 0;
  for (std::size_t i = 0; i < buckets; ++i) {
    seen += counts_[i];
    if (seen >= rank) return 1e-3 * std::min(middle_us(i), static_cast<double>(max_us_));
  }
  return 0.0;
}

double DurationHistogram::mean_ms() const {
  return count_ == 0 ? std::numeric_limits<double>::quiet_NaN()
                     : 1e-3 * sum_us_ / static_cast<double>(count_);
}

}  // namespace catgs::load

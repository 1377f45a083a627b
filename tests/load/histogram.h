#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace catgs::load {

/// Durations in bounded memory, however long the run: 64 buckets per octave, so that a percentile
/// is off by less than 0.8 %. Mean and maximum are exact.
class DurationHistogram {
 public:
  /// Microseconds; negative ones count as 0, those above 2^40 (twelve days) as that.
  void add(std::int64_t duration_us);
  void add(const DurationHistogram& other);

  [[nodiscard]] std::uint64_t count() const { return count_; }
  /// Milliseconds; NaN where nothing was added. `share` in 0…1, nearest rank.
  [[nodiscard]] double percentile_ms(double share) const;
  [[nodiscard]] double mean_ms() const;
  [[nodiscard]] double max_ms() const { return 1e-3 * static_cast<double>(max_us_); }

 private:
  static constexpr int octave_bits = 6;
  static constexpr int max_bits = 40;
  static constexpr std::size_t buckets = (max_bits - octave_bits + 1) << octave_bits;
  static std::size_t bucket_of(std::int64_t duration_us);
  static double middle_us(std::size_t bucket);

  std::array<std::uint32_t, buckets> counts_{};
  std::uint64_t count_ = 0;
  std::int64_t max_us_ = 0;
  double sum_us_ = 0.0;
};

}  // namespace catgs::load

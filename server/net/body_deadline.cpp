#include "server/net/body_deadline.h"

#include <algorithm>

namespace catgs {
namespace {

Clock::duration time_for(std::size_t bytes, double bytes_per_s) {
  return std::chrono::duration_cast<Clock::duration>(
      std::chrono::duration<double>(static_cast<double>(bytes) / bytes_per_s));
}

}  // namespace

BodyDeadline::BodyDeadline(std::size_t bytes, TimePoint now)
    : whole_(now + whole_time + time_for(bytes, whole_bytes_per_s)), progress_(now + grace) {}

void BodyDeadline::arrived(std::size_t bytes, TimePoint now) {
  progress_ = std::min(progress_ + time_for(bytes, least_bytes_per_s), now + grace);
}

TimePoint BodyDeadline::at() const { return std::min(whole_, progress_); }

}  // namespace catgs

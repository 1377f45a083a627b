#include "server/visit/session_usage.h"

#include <algorithm>
#include <cmath>
#include <ctime>
#include <numeric>
#include <utility>

namespace catgs {
namespace {

double seconds_between(TimePoint from, TimePoint to) {
  return std::chrono::duration<double>(to - from).count();
}

/// A share of time, averaged over the recent past.
void follow(double& share, double busy_s, double interval_s) {
  constexpr double span_s = 2.0;
  if (interval_s > 0)
    share += (busy_s / interval_s - share) * (1.0 - std::exp(-interval_s / span_s));
}

}  // namespace

void RecentTimes::add(double seconds) {
  if (values_.size() < capacity)
    values_.push_back(seconds);
  else
    values_[next_] = seconds;
  next_ = (next_ + 1) % capacity;
}

std::optional<Percentiles> RecentTimes::percentiles() const {
  if (values_.empty()) return std::nullopt;
  std::vector<double> sorted = values_;
  std::ranges::sort(sorted);
  // Nearest rank.
  const auto at = [&](std::size_t percent) {
    return sorted[(sorted.size() * percent + 99) / 100 - 1];
  };
  return Percentiles{at(50), at(95), at(99)};
}

void SessionUsage::frame_started(TimePoint now) { under_way_since_ = now; }

void SessionUsage::frame_ended(const FrameTicket& ticket, double device_seconds, TimePoint now,
                               double frames) {
  if (const auto since = std::exchange(under_way_since_, std::nullopt))
    busy_seconds_ += seconds_between(*since, now);
  gpu_seconds_ += device_seconds;
  const double encoding =
      ticket.encode ? seconds_between(ticket.encode->start, ticket.encode->end) : 0.0;
  encoding_seconds_ += encoding;
  if (encoding > 0 && !ticket.still)
    encode_seconds_ += encode_seconds_ == 0 ? encoding : (encoding - encode_seconds_) / 16.0;
  if (ticket.refined) return;
  rendered_ += frames;
  rendered_gpu_seconds_ += device_seconds;
}

void SessionUsage::add(SessionTime time, TimePoint from, TimePoint to) {
  times_[static_cast<std::size_t>(time)].add(seconds_between(from, to));
}

void SessionUsage::frame_sent(const FrameTicket& ticket, TimePoint now) {
  add(SessionTime::send, ticket.encode->end, now);
  add(SessionTime::encode, ticket.encode->start, ticket.encode->end);
  if (ticket.still) return;  // late on purpose, and perhaps larger
  add(SessionTime::queue_wait, ticket.ready, ticket.started);
  add(SessionTime::render, ticket.render->start, ticket.render->end);
  add(SessionTime::pose_to_frame, ticket.pose_received, now);
}

void SessionUsage::frame_shown(double motion_to_photon_s) {
  times_[static_cast<std::size_t>(SessionTime::motion_to_photon)].add(motion_to_photon_s);
}

double SessionUsage::take_busy_seconds(TimePoint now) {
  if (under_way_since_)
    busy_seconds_ += seconds_between(std::exchange(*under_way_since_, now), now);
  return std::exchange(busy_seconds_, 0.0);
}

void SessionUsage::charge_cpu(double seconds, double interval_s) {
  cpu_seconds_ += seconds;
  const double frames = std::exchange(rendered_, 0.0);
  const double gpu_seconds = std::exchange(rendered_gpu_seconds_, 0.0);
  const double encoding_seconds = std::exchange(encoding_seconds_, 0.0);
  follow(gpu_load_, gpu_seconds, interval_s);
  follow(encoder_load_, encoding_seconds, interval_s);
  if (frames == 0) return;
  constexpr double span_frames = 32;  // window of the means
  frames_measured_ += frames;
  const double weight = std::min(1.0, frames / std::min(frames_measured_, span_frames));
  cost_.cpu_seconds += (seconds / frames - cost_.cpu_seconds) * weight;
  cost_.gpu_seconds += (gpu_seconds / frames - cost_.gpu_seconds) * weight;
}

std::optional<SessionUsage::FrameCost> SessionUsage::frame_cost() const {
  constexpr int enough_frames = 8;
  if (frames_measured_ < enough_frames) return std::nullopt;
  return cost_;
}

void SessionUsage::scale_frame_cost(double factor) {
  cost_.cpu_seconds *= factor;
  cost_.gpu_seconds *= factor;
}

std::optional<double> SessionUsage::gpu_load() const {
  if (!frame_cost()) return std::nullopt;
  return gpu_load_;
}

std::vector<double> share_out(double seconds, const std::vector<double>& busy_seconds) {
  const double busy = std::accumulate(busy_seconds.begin(), busy_seconds.end(), 0.0);
  std::vector<double> shares(busy_seconds.size(), 0.0);
  if (busy > 0.0)
    std::ranges::transform(busy_seconds, shares.begin(),
                           [&](double own) { return seconds * own / busy; });
  return shares;
}

double process_cpu_seconds() {
  timespec time{};
  ::clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

}  // namespace catgs

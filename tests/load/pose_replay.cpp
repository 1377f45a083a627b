#include "tests/load/pose_replay.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

namespace catgs::load {
namespace {

constexpr std::int64_t still_interval_us = 16'667;

}  // namespace

PoseReplay::PoseReplay(std::shared_ptr<const Trajectory> trajectory, std::int64_t offset_us)
    : trajectory_(std::move(trajectory)), offset_us_(std::max<std::int64_t>(offset_us, 0)) {
  if (trajectory_->empty()) throw std::invalid_argument("PoseReplay: the trajectory is empty");
  if (span_us() > 0) offset_us_ %= 2 * span_us();
  while (time_us(number_) < offset_us_) ++number_;
}

std::int64_t PoseReplay::span_us() const {
  return trajectory_->back().time_us - trajectory_->front().time_us;
}

std::size_t PoseReplay::index(std::int64_t number) const {
  const auto last = static_cast<std::int64_t>(trajectory_->size()) - 1;
  if (last == 0) return 0;
  const std::int64_t step = number % (2 * last);
  return static_cast<std::size_t>(step <= last ? step : 2 * last - step);
}

std::int64_t PoseReplay::time_us(std::int64_t number) const {
  const auto last = static_cast<std::int64_t>(trajectory_->size()) - 1;
  if (last == 0) return number * still_interval_us;
  const std::int64_t turn = number / (2 * last);
  const bool forth = number % (2 * last) <= last;
  const std::int64_t way = (*trajectory_)[index(number)].time_us - trajectory_->front().time_us;
  return turn * 2 * span_us() + (forth ? way : 2 * span_us() - way);
}

std::int64_t PoseReplay::next_time_us() const { return time_us(number_) - offset_us_; }

const Pose& PoseReplay::take() { return (*trajectory_)[index(number_++)].world_from_camera; }

}  // namespace catgs::load

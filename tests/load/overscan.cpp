#include "tests/load/overscan.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>
#include <utility>

#include "render_core/metrics/summary.h"

namespace catgs::load {
namespace {

// As in warp_policy.ts.
constexpr std::array widths = {1.0, 1.12, 1.26, 1.42, 1.6};
constexpr std::array heights = {1.0, 1.12, 1.26};
constexpr std::size_t least_samples = 12;
constexpr std::int64_t calm_before_less_us = 10'000'000;
constexpr double no_motion = 1e-6;

// As in turn_forecast.ts.
constexpr std::int64_t rate_span_us = 80'000;
constexpr double slow_rad_s = 0.2;
constexpr double first_lag_s = 0.1;
constexpr double longest_lag_s = 0.4;
constexpr double largest_turn_rad = 0.5;

double fitting(std::span<const double> factors, double needed) {
  const auto found =
      std::ranges::find_if(factors, [&](double factor) { return factor >= needed - 0.005; });
  return found == factors.end() ? factors.back() : *found;
}

double angle_between(const glm::dquat& a, const glm::dquat& b) {
  return 2.0 * std::acos(std::min(1.0, std::abs(glm::dot(a, b))));
}

}  // namespace

glm::dvec2 even_overscan(const glm::dvec2& factors, glm::ivec2 view_px) {
  const auto even = [](double factor, int px) {
    return factor == 1.0 ? 1.0 : 2.0 * std::round(factor * px / 2.0) / px;
  };
  return {even(factors.x, view_px.x), even(factors.y, view_px.y)};
}

void TimeWindow::push(std::int64_t time_us, double value) {
  values_.emplace_back(time_us, value);
  while (values_.front().first < time_us - span_us_) values_.pop_front();
}

std::vector<double> TimeWindow::sorted(std::int64_t now_us) const {
  std::vector<double> values;
  for (const auto& [time_us, value] : values_) {
    if (time_us >= now_us - span_us_) values.push_back(value);
  }
  std::ranges::sort(values);
  return values;
}

void Overscan::moved(std::int64_t now_us, const Pose& camera) {
  // After a rest a turn begins anew.
  if (!samples_.empty() && now_us - samples_.back().time_us > 2 * rate_span_us) samples_.clear();
  samples_.push_back({now_us, glm::normalize(glm::dquat(camera.orientation))});
  while (samples_.size() > 2 && samples_[1].time_us <= now_us - rate_span_us) samples_.pop_front();
}

std::optional<glm::dquat> Overscan::later(std::int64_t now_us) const {
  if (samples_.size() < 2) return {};
  const Sample &oldest = samples_.front(), &newest = samples_.back();
  const std::vector<double> lags = lags_s_.sorted(now_us);
  const double lag_s = lags.empty() ? first_lag_s : percentile(lags, 0.9);
  const double over_s = 1e-6 * static_cast<double>(newest.time_us - oldest.time_us);
  const double turn_rad = angle_between(oldest.orientation, newest.orientation);
  const double times = std::min(lag_s / over_s, largest_turn_rad / std::max(turn_rad, 1e-9));
  return glm::slerp(oldest.orientation, newest.orientation, 1.0 + times);
}

bool Overscan::drawn(const Eye& picture, double picture_aspect, const Eye& view, double view_aspect,
                     double distance, std::int64_t now_us) {
  if (samples_.size() >= 2) {
    const Sample &oldest = samples_.front(), &newest = samples_.back();
    const double over_s = 1e-6 * static_cast<double>(newest.time_us - oldest.time_us);
    const double turn_rad = angle_between(oldest.orientation, newest.orientation);
    const glm::dquat shown = glm::normalize(glm::dquat(picture.world_from_camera.orientation));
    const double behind_rad = angle_between(shown, newest.orientation);
    if (turn_rad > slow_rad_s * over_s)
      lags_s_.push(now_us, std::min(behind_rad * over_s / turn_rad, longest_lag_s));
  }
  const double tall = std::tan(0.5 * picture.fov_y_rad) / std::tan(0.5 * view.fov_y_rad);
  const double wide = tall * picture_aspect / view_aspect;
  glm::dvec2 needed = reach(warp_matrix(picture, view, picture_aspect, view_aspect, distance)) *
                      glm::dvec2(wide, tall);
  if (std::max(std::abs(needed.x - 1.0), std::abs(needed.y - 1.0)) < no_motion) return false;
  if (const auto orientation = later(now_us)) {
    const Pose pose{view.world_from_camera.position, glm::quat(*orientation)};
    needed =
        glm::max(needed, reach(warp_matrix(view, {pose, view.fov_y_rad}, view_aspect, view_aspect,
                                           std::numeric_limits<double>::infinity())));
  }
  widths_.push(now_us, needed.x);
  heights_.push(now_us, needed.y);
  const std::vector<double> x = widths_.sorted(now_us), y = heights_.sorted(now_us);
  return x.size() >= least_samples && choose({percentile(x, 0.9), percentile(y, 0.9)}, now_us);
}

bool Overscan::choose(const glm::dvec2& needed, std::int64_t now_us) {
  const glm::dvec2 wanted(fitting(widths, needed.x), fitting(heights, needed.y));
  const glm::dvec2 larger = glm::max(wanted, sides_);
  // Turns change their axis, so a side that is too large stays while the other one is needed.
  const bool is_needed =
      (sides_.x > 1.0 && wanted.x >= sides_.x) || (sides_.y > 1.0 && wanted.y >= sides_.y);
  if (is_needed || larger != sides_) needed_us_ = now_us;
  if (larger != sides_) {
    sides_ = larger;
    return true;
  }
  if (wanted == sides_ || (needed_us_ && now_us - *needed_us_ <= calm_before_less_us)) return false;
  sides_ = wanted;
  return true;
}

}  // namespace catgs::load

#include "server/counts/visit_counts.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include <fmt/format.h>

namespace catgs {

std::string date_of(std::int64_t unix_s) {
  using namespace std::chrono;
  const year_month_day date(floor<days>(sys_seconds(seconds(unix_s))));
  return fmt::format("{:04}-{:02}-{:02}", static_cast<int>(date.year()),
                     static_cast<unsigned>(date.month()), static_cast<unsigned>(date.day()));
}

bool is_date(std::string_view text) {
  constexpr std::string_view form = "0000-00-00";
  return text.size() == form.size() && std::ranges::equal(text, form, [](char c, char of_form) {
           return of_form == '-' ? c == '-' : c >= '0' && c <= '9';
         });
}

DayCounts& VisitCounts::today() {
  const std::string date = date_of(unix_s_());
  changed_.insert(date);
  // The clock may be behind, so the oldest day may not be the one to make.
  if (!days_.contains(date) && days_.size() >= most_days) days_.erase(days_.begin());
  return days_[date];
}

SceneCounts& VisitCounts::counts_of(const std::string& scene_id, DayCounts& day) {
  if (day.size() < most_scenes || day.contains(scene_id)) return day[scene_id];
  return day[std::string(other_scenes)];
}

void VisitCounts::visit(const std::string& scene_id, DeviceKind device) {
  const std::lock_guard lock(mutex_);
  SceneCounts& counts = counts_of(scene_id, today());
  ++counts.visits;
  ++counts.devices[static_cast<std::size_t>(device)];
}

void VisitCounts::spend(const std::string& scene_id, double seconds, std::uint64_t bytes) {
  const std::lock_guard lock(mutex_);
  SceneCounts& counts = counts_of(scene_id, today());
  counts.seconds += seconds;
  counts.bytes += bytes;
}

void VisitCounts::reach(const std::string& scene_id, StopId stop) {
  const std::lock_guard lock(mutex_);
  DayCounts& day = today();  // one look at the clock, which may pass midnight
  auto& stops = counts_of(scene_id, day).stops;
  if (const auto known = stops.find(stop); known != stops.end()) {
    ++known->second;
    return;
  }
  std::size_t all = 0;
  for (const auto& [id, counts] : day) all += counts.stops.size();
  if (all < most_stops) stops[stop] = 1;
}

void VisitCounts::restore(const std::string& date, DayCounts counts) {
  const std::lock_guard lock(mutex_);
  days_[date] = std::move(counts);
  while (days_.size() > most_days) days_.erase(days_.begin());
}

CountsByDay VisitCounts::since(std::string_view date) const {
  const std::lock_guard lock(mutex_);
  return {days_.lower_bound(date), days_.end()};
}

void VisitCounts::mark_changed(const std::string& date) {
  const std::lock_guard lock(mutex_);
  changed_.insert(date);
}

CountsByDay VisitCounts::take_changed() {
  const std::lock_guard lock(mutex_);
  CountsByDay changed;
  for (const std::string& date : std::exchange(changed_, {}))
    if (const auto day = days_.find(date); day != days_.end()) changed.insert(*day);
  return changed;
}

}  // namespace catgs

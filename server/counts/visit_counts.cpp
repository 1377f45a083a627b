#include "server/counts/visit_counts.h"

#include <algorithm>
#include <chrono>

#include <fmt/format.h>

namespace catgs {
namespace {

/// Stops and links.
std::size_t details_of(const DayCounts& day) {
  std::size_t details = 0;
  for (const auto& [id, counts] : day) details += counts.stops.size() + counts.links.size();
  return details;
}

std::size_t entries_of(const DayCounts& day) { return day.size() + details_of(day); }

SceneCounts& scene_of(const std::string& id, DayCounts& day) {
  const std::string others(VisitCounts::other_scenes);
  const std::size_t told_apart = day.size() - day.count(others);
  return told_apart < VisitCounts::most_scenes || day.contains(id) ? day[id] : day[others];
}

/// `details`: of the whole day.
template <typename Id>
void add_detail(const Id& id, std::uint64_t visits, std::map<Id, std::uint64_t>& to,
                std::size_t& details) {
  if (details >= VisitCounts::most_stops && !to.contains(id)) return;
  const auto [counted, is_new] = to.try_emplace(id, 0);
  counted->second += visits;
  details += is_new ? 1 : 0;
}

}  // namespace

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

void add(const DayCounts& from, DayCounts& to) {
  std::size_t details = details_of(to);
  for (const auto& [id, counts] : from) {
    SceneCounts& sum = scene_of(id, to);
    sum.visits += counts.visits;
    sum.seconds += counts.seconds;
    sum.bytes += counts.bytes;
    for (std::size_t i = 0; i < device_kinds; ++i) sum.devices[i] += counts.devices[i];
    for (const auto& [stop, visits] : counts.stops) add_detail(stop, visits, sum.stops, details);
    for (const auto& [link, visits] : counts.links) add_detail(link, visits, sum.links, details);
  }
}

DayCounts& VisitCounts::today() {
  const std::string date = date_of(unix_s_());
  // The clock may be behind, so the oldest day may not be the one to make.
  while (days_.size() > 1 &&
         (entries_ > most_entries || (!days_.contains(date) && days_.size() >= most_days))) {
    auto oldest = days_.begin();
    if (oldest->first == date) ++oldest;
    entries_ -= entries_of(oldest->second);
    days_.erase(oldest);
  }
  return days_[date];
}

SceneCounts& VisitCounts::counts_of(const std::string& scene_id, DayCounts& day) {
  const std::size_t before = day.size();
  SceneCounts& counts = scene_of(scene_id, day);
  entries_ += day.size() - before;
  return counts;
}

void VisitCounts::visit(const std::string& scene_id, DeviceKind device,
                        const std::string& link_id) {
  const std::lock_guard lock(mutex_);
  DayCounts& day = today();  // one look at the clock, which may pass midnight
  SceneCounts& counts = counts_of(scene_id, day);
  ++counts.visits;
  ++counts.devices[static_cast<std::size_t>(device)];
  if (link_id.empty()) return;
  const std::size_t before = details_of(day);
  std::size_t details = before;
  add_detail(link_id, 1, counts.links, details);
  entries_ += details - before;
}

void VisitCounts::spend(const std::string& scene_id, double seconds, std::uint64_t bytes) {
  const std::lock_guard lock(mutex_);
  SceneCounts& counts = counts_of(scene_id, today());
  counts.seconds += seconds;
  counts.bytes += bytes;
}

void VisitCounts::reach(const std::string& scene_id, StopId stop) {
  const std::lock_guard lock(mutex_);
  DayCounts& day = today();
  const std::size_t before = details_of(day);
  std::size_t details = before;
  add_detail(stop, 1, counts_of(scene_id, day).stops, details);
  entries_ += details - before;
}

std::vector<std::string> VisitCounts::dates() const {
  const std::lock_guard lock(mutex_);
  std::vector<std::string> dates;
  for (const auto& [date, day] : days_) dates.push_back(date);
  return dates;
}

DayCounts VisitCounts::day(const std::string& date) const {
  const std::lock_guard lock(mutex_);
  const auto day = days_.find(date);
  return day == days_.end() ? DayCounts() : day->second;
}

DayCounts VisitCounts::take(const std::string& date) {
  const std::lock_guard lock(mutex_);
  auto day = days_.extract(date);
  if (!day) return {};
  entries_ -= entries_of(day.mapped());
  return DayCounts(std::move(day.mapped()));
}

void VisitCounts::put_back(const std::string& date, const DayCounts& counts) {
  const std::lock_guard lock(mutex_);
  DayCounts& day = days_[date];
  entries_ -= entries_of(day);
  add(counts, day);
  entries_ += entries_of(day);
}

}  // namespace catgs

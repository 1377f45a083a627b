#include "server/counts/usage_statistics.h"

#include <algorithm>
#include <exception>
#include <iterator>
#include <string_view>
#include <system_error>
#include <utility>

#include <nlohmann/json.hpp>

#include "render_core/base/error.h"
#include "render_core/scene/formats/json_field.h"
#include "server/base/log_event.h"
#include "server/base/replace_file.h"

namespace catgs {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t max_bytes = 16 << 20;  // a day within all limits has less
constexpr std::string_view prefix = "visits-", extension = ".json";

/// The date in the name of a day's file; empty: it is none.
std::string date_in(const fs::path& file) {
  std::string name = file.filename().string();
  if (!name.starts_with(prefix) || !name.ends_with(extension)) return {};
  name = name.substr(prefix.size(), name.size() - prefix.size() - extension.size());
  return is_date(name) ? name : std::string();
}

}  // namespace

std::string counts_json(const DayCounts& day) {
  auto scenes = nlohmann::json::object();
  for (const auto& [id, counts] : day) {
    auto devices = nlohmann::json::object();
    for (std::size_t i = 0; i < device_kinds; ++i)
      devices[std::string(device_names[i])] = counts.devices[i];
    auto stops = nlohmann::json::array();
    for (const auto& [stop, count] : counts.stops)
      stops.push_back({{"tour", stop.tour}, {"stop", stop.stop}, {"visits", count}});
    scenes[id] = {{"visits", counts.visits},   {"seconds", counts.seconds},
                  {"bytes", counts.bytes},     {"devices", std::move(devices)},
                  {"stops", std::move(stops)}, {"links", counts.links}};
  }
  return nlohmann::json{{"scenes", std::move(scenes)}}.dump(
      1, ' ', false, nlohmann::json::error_handler_t::replace);
}

DayCounts read_counts(const ByteSource& file) {
  const nlohmann::json document = read_json(file, max_bytes);
  const JsonField scenes = JsonField(file.name(), document).at("scenes");
  if (!scenes.value().is_object()) scenes.fail("is no object");
  DayCounts day;
  for (const auto& [id, value] : scenes.value().items()) {
    const JsonField scene = scenes.at(id);
    SceneCounts& counts = day[id];
    counts.visits = scene.at("visits").count();
    const JsonField seconds = scene.at("seconds");
    if (!seconds.value().is_number() || !(seconds.value().get<double>() >= 0.0))
      seconds.fail("is no time");
    counts.seconds = seconds.value().get<double>();
    counts.bytes = scene.at("bytes").count();
    for (std::size_t i = 0; i < device_kinds; ++i)
      if (const auto devices = scene.at("devices").find(device_names[i]))
        counts.devices[i] = devices->count();
    const JsonField stops = scene.at("stops");
    for (std::size_t i = 0; i < std::min(stops.size(), VisitCounts::most_stops); ++i) {
      const StopId stop{static_cast<std::uint32_t>(stops[i].at("tour").count()),
                        static_cast<std::uint32_t>(stops[i].at("stop").count())};
      counts.stops[stop] = stops[i].at("visits").count();
    }
    if (const auto links = scene.find("links"); links && links->value().is_object())
      for (const auto& [link, visits] : links->value().items())
        if (counts.links.size() < VisitCounts::most_stops)
          counts.links[link] = links->at(link).count();
    if (day.size() > VisitCounts::most_scenes + 1) scenes.fail("has too many scenes");
  }
  return day;
}

UsageStatistics::UsageStatistics(fs::path folder, VisitCounts& counts, Background& background,
                                 std::chrono::milliseconds save_interval)
    : folder_(std::move(folder)), counts_(counts), jobs_(background) {
  if (folder_.empty()) return;
  lock_.emplace(own_folder("--visit-counts", folder_, "visits.lock"));
  drop_old_days();
  jobs_.start(lanes.visit_counts, Priority::normal,
              [this, save_interval, waited = false](const std::stop_token&) mutable {
                if (std::exchange(waited, true)) try {
                    save();
                  } catch (const std::exception& failure) {
                    log_warning({.event = "visit_counts_unwritten"}, "visits are not saved: {}",
                                failure.what());
                  }
                return std::optional<Clock::duration>(save_interval);
              });
}

UsageStatistics::~UsageStatistics() {
  jobs_.end();
  if (!folder_.empty()) save();
}

fs::path UsageStatistics::file_of(const std::string& date) const {
  return folder_ / (std::string(prefix) + date + std::string(extension));
}

std::vector<std::string> UsageStatistics::saved_dates() const {
  std::vector<std::string> dates;
  std::error_code error;
  for (fs::directory_iterator entry(folder_, error), end; !error && entry != end;
       entry.increment(error))
    if (std::string date = date_in(entry->path()); !date.empty()) dates.push_back(std::move(date));
  std::ranges::sort(dates);
  return dates;
}

void UsageStatistics::drop_old_days() const {
  const std::vector<std::string> dates = saved_dates();
  std::error_code error;
  for (std::size_t i = 0; i + VisitCounts::most_days < dates.size(); ++i)
    fs::remove(file_of(dates[i]), error);
}

std::vector<std::string> UsageStatistics::dates() const {
  const std::lock_guard lock(files_mutex_);
  std::vector<std::string> dates = counts_.dates();
  if (folder_.empty()) return dates;
  std::ranges::copy(saved_dates(), std::back_inserter(dates));
  std::ranges::sort(dates);
  const auto twice = std::ranges::unique(dates);
  dates.erase(twice.begin(), twice.end());
  return dates;
}

DayCounts UsageStatistics::day(const std::string& date) const {
  if (folder_.empty()) return counts_.day(date);
  const std::lock_guard lock(files_mutex_);
  DayCounts day = saved(date);
  add(counts_.day(date), day);
  return day;
}

DayCounts UsageStatistics::saved(const std::string& date) const {
  const fs::path file = file_of(date);
  std::error_code error;
  const fs::file_type type = fs::symlink_status(file, error).type();
  if (type == fs::file_type::not_found) return {};
  if (type == fs::file_type::regular) FileSource{file};  // throws: it may be opened later
  try {
    return read_counts(FileSource(file));
  } catch (const InputError& failure) {
    log_warning({.event = "visit_counts_unreadable"}, "set aside as .damaged: {}", failure.what());
    fs::rename(file, file.string() + ".damaged", error);
    return {};
  }
}

void UsageStatistics::save() {
  for (const std::string& date : counts_.dates()) {
    const std::lock_guard lock(files_mutex_);
    save(date);
  }
}

/// Counts that cannot be written wait for the next time.
void UsageStatistics::save(const std::string& date) {
  std::error_code error;
  const bool is_new = !fs::exists(file_of(date), error);
  const DayCounts fresh = counts_.take(date);
  try {
    DayCounts day = saved(date);
    add(fresh, day);
    overwrite_file(file_of(date), counts_json(day), "make room for it");
  } catch (const std::exception& failure) {
    counts_.put_back(date, fresh);
    log_warning({.event = "visit_counts_unwritten"}, "visits are not saved: {}", failure.what());
    return;
  }
  if (is_new) drop_old_days();
}

}  // namespace catgs

#include "server/counts/visit_book.h"

#include <algorithm>
#include <chrono>
#include <system_error>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "render_core/base/error.h"
#include "render_core/base/part_file.h"
#include "render_core/scene/formats/json_field.h"
#include "server/base/log_event.h"

namespace catgs {
namespace {

namespace fs = std::filesystem;

constexpr std::chrono::minutes save_interval{1};
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
    scenes[id] = {{"visits", counts.visits},
                  {"seconds", counts.seconds},
                  {"bytes", counts.bytes},
                  {"devices", std::move(devices)},
                  {"stops", std::move(stops)}};
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
    if (day.size() > VisitCounts::most_scenes + 1) scenes.fail("has too many scenes");
  }
  return day;
}

VisitBook::VisitBook(fs::path folder, VisitCounts& counts)
    : folder_(std::move(folder)), counts_(counts) {
  restore();
  thread_ = std::jthread([this](const std::stop_token& stop) {
    std::unique_lock lock(mutex_);
    do {
      wake_.wait_for(lock, stop, save_interval, [] { return false; });
      save();
    } while (!stop.stop_requested());
  });
}

VisitBook::~VisitBook() = default;

void VisitBook::restore() {
  const auto refuse = [&](const std::string& why) {
    throw InputError("--visit-counts " + folder_.string(), {}, why,
                     "name a folder that the server may write, or \"memory\", or \"off\"");
  };
  std::error_code error;
  fs::create_directories(folder_, error);
  if (error && !fs::is_directory(folder_)) refuse(error.message());
  check_writable(folder_ / "visits-0000-00-00.json");
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(folder_, error))
    if (!date_in(entry.path()).empty()) files.push_back(entry.path());
  if (error) refuse(error.message());
  std::ranges::sort(files);
  while (files.size() > VisitCounts::most_days) {
    fs::remove(files.front(), error);
    files.erase(files.begin());
  }
  for (const fs::path& file : files) {
    try {
      counts_.restore(date_in(file), read_counts(FileSource(file)));
    } catch (const InputError& failure) {
      log_warning({.event = "visit_counts_unreadable"}, "set aside as .damaged: {}",
                  failure.what());
      fs::rename(file, file.string() + ".damaged", error);
    }
  }
}

/// A day that cannot be written is tried again the next time.
void VisitBook::save() {
  for (const auto& [date, day] : counts_.take_changed()) {
    try {
      PartFile file(folder_ / (std::string(prefix) + date + std::string(extension)));
      file.stream() << counts_json(day);
      file.finish();
    } catch (const InputError& failure) {
      counts_.mark_changed(date);
      log_warning({.event = "visit_counts_unwritten"}, "visits are not saved: {}", failure.what());
    }
  }
}

}  // namespace catgs

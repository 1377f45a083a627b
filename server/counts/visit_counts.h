#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "server/net/messages.h"

namespace catgs {

/// A stop of a tour, both counted from 0, as pages number them.
struct StopId {
  std::uint32_t tour = 0, stop = 0;

  auto operator<=>(const StopId&) const = default;
};

/// The counts of one scene on one day. Nothing in it tells visitors apart.
struct SceneCounts {
  std::uint64_t visits = 0;
  double seconds = 0.0;     // on show: connected, and the page was not hidden
  std::uint64_t bytes = 0;  // of pictures
  std::array<std::uint64_t, device_kinds> devices{};  // visits, by DeviceKind
  std::map<StopId, std::uint64_t> stops{};            // visits that reached the stop
  std::map<std::string, std::uint64_t> links{};       // visits, by the id of their link
};

using DayCounts = std::map<std::string, SceneCounts>;  // by the scene's id

/// Counts visits by scene and day. Thread-safe.
class VisitCounts {
 public:
  static constexpr std::size_t most_days = 400;
  /// On one day. Further scenes are counted together, as `other_scenes`.
  static constexpr std::size_t most_scenes = 1000;
  /// Stops and links on one day, in all scenes. Further ones are not counted.
  static constexpr std::size_t most_stops = 20'000;
  /// Scenes, stops and links of all days. Beyond it the oldest day goes.
  static constexpr std::size_t most_entries = 400'000;
  static constexpr std::string_view other_scenes = "(others)";

  /// `unix_s`: the time, which decides about the day.
  explicit VisitCounts(std::function<std::int64_t()> unix_s) : unix_s_(std::move(unix_s)) {}

  /// `link_id`: empty: the visitor came by no link.
  void visit(const std::string& scene_id, DeviceKind device, const std::string& link_id = {});
  void spend(const std::string& scene_id, double seconds, std::uint64_t bytes);
  void reach(const std::string& scene_id, StopId stop);

  /// The days that have counts, oldest first.
  [[nodiscard]] std::vector<std::string> dates() const;
  /// Empty: nothing was counted.
  [[nodiscard]] DayCounts day(const std::string& date) const;
  /// Hands over the counts of a day, which then start at zero.
  DayCounts take(const std::string& date);
  /// Takes counts back that were handed over.
  void put_back(const std::string& date, const DayCounts& counts);

 private:
  // The lock is held.
  DayCounts& today();
  SceneCounts& counts_of(const std::string& scene_id, DayCounts& day);

  const std::function<std::int64_t()> unix_s_;
  mutable std::mutex mutex_;               // guards the rest
  std::map<std::string, DayCounts> days_;  // by date, "2026-11-25" in UTC
  std::size_t entries_ = 0;                // in all of them
};

/// Adds the counts of a day, or of a part of it, to `to`, within the limits of a day.
void add(const DayCounts& from, DayCounts& to);

/// The date in UTC of a Unix time.
std::string date_of(std::int64_t unix_s);
/// True for "2026-11-25".
bool is_date(std::string_view text);

}  // namespace catgs

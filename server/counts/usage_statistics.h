#pragma once

#include <chrono>
#include <filesystem>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "render_core/scene/formats/byte_source.h"
#include "server/base/background.h"
#include "server/base/file_lock.h"
#include "server/counts/visit_counts.h"

namespace catgs {

/// The counts of one day as JSON.
std::string counts_json(const DayCounts& day);
/// The inverse. Throws InputError that names the field.
DayCounts read_counts(const ByteSource& file);

/// The counts of all days. A folder keeps them, in a file for each day:
/// "visits-2026-11-25.json". What was counted is added to it once a minute, in the background, and
/// at the end. To forget a day, delete its file while no server runs.
class UsageStatistics {
 public:
  /// `folder`: empty: counts stay in memory. It is made if needed, and belongs to this process as
  /// long as the statistics exists. Files of days that are too long ago are deleted. No day is
  /// read. Throws InputError where the folder cannot be used. `counts` outlives this object.
  UsageStatistics(std::filesystem::path folder, VisitCounts& counts, Background& background,
                  std::chrono::milliseconds save_interval = std::chrono::minutes(1));
  ~UsageStatistics();
  UsageStatistics(const UsageStatistics&) = delete;
  UsageStatistics& operator=(const UsageStatistics&) = delete;

  /// The days that have counts, oldest first. Any thread. May block.
  [[nodiscard]] std::vector<std::string> dates() const;
  /// A file without counts is set aside as "….damaged", with a warning. Throws InputError for one
  /// that cannot be opened now. Any thread. May block.
  [[nodiscard]] DayCounts day(const std::string& date) const;

 private:
  void save();
  // The lock is held.
  void save(const std::string& date);
  [[nodiscard]] DayCounts saved(const std::string& date) const;
  [[nodiscard]] std::filesystem::path file_of(const std::string& date) const;
  [[nodiscard]] std::vector<std::string> saved_dates() const;
  void drop_old_days() const;

  const std::filesystem::path folder_;
  std::optional<FileLock> lock_;  // of the folder
  VisitCounts& counts_;
  mutable std::mutex files_mutex_;  // what is in a file is not in `counts_`
  Background::Jobs jobs_;
};

}  // namespace catgs

#pragma once

#include <condition_variable>
#include <filesystem>
#include <mutex>
#include <stop_token>
#include <string>
#include <string_view>
#include <thread>

#include "render_core/scene/formats/byte_source.h"
#include "server/counts/visit_counts.h"

namespace catgs {

/// The counts of one day as JSON.
std::string counts_json(const DayCounts& day);
/// The inverse. Throws InputError that names the field.
DayCounts read_counts(const ByteSource& file);

/// Keeps counts in a folder, a file for each day: "visits-2026-11-25.json". They are written once a
/// minute and at the end, on a thread of its own. To forget a day, delete its file while no server
/// runs.
class VisitBook {
 public:
  /// Makes the folder if needed, and restores its days. Files of days that are too long ago are
  /// deleted. One that cannot be read is set aside as "….damaged", with a warning. Throws
  /// InputError where the folder cannot be used. `counts` outlives the book.
  VisitBook(std::filesystem::path folder, VisitCounts& counts);
  ~VisitBook();

 private:
  void restore();
  void save();

  const std::filesystem::path folder_;
  VisitCounts& counts_;
  std::mutex mutex_;
  std::condition_variable_any wake_;
  std::jthread thread_;
};

}  // namespace catgs

#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "server/base/clock.h"
#include "server/base/result_file.h"
#include "server/films/film_request.h"

namespace catgs {

enum class FilmState { waiting, drawing, done, failed, cancelled };

/// The facts of a job for its author.
struct FilmReport {
  FilmKind kind = FilmKind::picture;
  std::string owner{};  // id of the token that ordered it: one job at a time for each
  FilmState state = FilmState::waiting;
  double share = 0.0;  // drawn
  std::string error{};
  TimePoint changed{};  // when it began or ended
  std::shared_ptr<const ResultFile> result{};
};
/// True if the job neither waits nor is being drawn.
bool has_ended(const FilmReport& job);

/// One order of a picture or a film.
struct FilmJob : FilmReport {
  std::string id;  // whoever knows it may ask for the result
  std::string scene_id;
  FilmRequest request;
  std::optional<int> content{};  // of the scene, if it was in memory: SceneLease::content()
};

/// The orders of authors: one is drawn at a time, and a few wait. Results are kept for an hour,
/// within bounds of number and bytes. Beyond a bound the owner who has most loses the oldest, so
/// nobody's orders throw away the results of others. Thread-safe.
class FilmQueue {
 public:
  static constexpr std::size_t most_waiting = 4;
  static constexpr std::size_t most_results = 8;
  static constexpr std::uint64_t most_result_bytes = std::uint64_t{1} << 30;
  static constexpr std::size_t most_without_result = 32;  // that have failed or were cancelled
  static constexpr std::chrono::hours kept_for{1};

  explicit FilmQueue(std::function<TimePoint()> clock = Clock::now) : clock_(std::move(clock)) {}

  struct Refused {
    bool has_one;  // its owner has a job that has not ended; else too many wait
  };
  /// Returns the id of the job.
  std::variant<std::string, Refused> add(std::string scene_id, std::string owner,
                                         FilmRequest request);
  /// The scene of a job that waits is in memory, so the job may wait for it when its turn comes.
  void found_scene(const std::string& id, int content);
  /// The job to be drawn now; nothing: none waits.
  std::optional<FilmJob> start_next();
  /// So much of the job is drawn. False: it was cancelled.
  bool drawn(const std::string& id, double share);
  /// Ends a job that was started.
  void finish(const std::string& id, std::shared_ptr<const ResultFile> result);
  void fail(const std::string& id, std::string why);
  /// False: there is no such job, or it has ended.
  bool cancel(std::string_view id);
  /// Nothing: there is no such job, or it ended too long ago.
  [[nodiscard]] std::optional<FilmReport> find(std::string_view id);
  /// The time that the rest of a job takes, by what was drawn so far; nothing: not known.
  [[nodiscard]] std::optional<std::chrono::seconds> left(const FilmReport& job) const;

 private:
  FilmJob* known(std::string_view id);
  void end(FilmJob& job, FilmState state);
  /// Returns the jobs that are too old or too many: large files take time to close, so the caller
  /// lets go of them once the mutex is free.
  [[nodiscard]] std::vector<FilmJob> drop_old();

  const std::function<TimePoint()> clock_;
  std::mutex mutex_;
  std::vector<FilmJob> jobs_;  // by time of order
};

}  // namespace catgs

#pragma once

#include <array>
#include <bit>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <functional>
#include <list>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <string_view>
#include <thread>
#include <type_traits>
#include <utility>
#include <vector>

#include <boost/asio/io_context.hpp>
#include <boost/asio/post.hpp>

#include "server/base/clock.h"

namespace catgs {

/// Jobs of one lane wait for each other, and never for those of another lane.
struct Lane {
  std::string_view name;
  std::size_t threads = 1;
  bool in_background = false;  // threads that serve visitors go first
};
struct Lanes {
  Lane disk{"disk", 2};  // pieces of files that are served
  Lane film_requests{"film requests"};
  Lane films{"films", 1, true};
  Lane media{"media"};        // authors' uploads
  Lane scenes{"scenes"};      // loads, and scans of folders
  Lane sidecars{"sidecars"};  // authors' saves
  Lane trees{"trees", 1, true};
  Lane visit_counts{"visit counts"};
  Lane walkable_areas{"walkable areas", 1, true};
};
inline constexpr Lanes lanes;
inline const auto all_lanes = std::bit_cast<std::array<Lane, sizeof(Lanes) / sizeof(Lane)>>(lanes);

/// Within a lane. A low job under way is stopped when a higher one waits, and starts anew later.
enum class Priority { low, normal, high };

/// Thrown by work that ends early because its stop was requested.
struct Cancelled {};

inline void throw_if_stopped(const std::stop_token& stop) {
  if (stop.stop_requested()) throw Cancelled();
}
/// Waits for `duration`, or until the stop is requested.
void sleep_unless_stopped(Clock::duration duration, const std::stop_token& stop);

/// The result of work, or why it failed. Neither: it was cancelled.
template <typename Result>
struct Finished {
  std::optional<Result> result{};
  std::string error{};
};

/// Runs all work of the server that may take long, on few threads for each lane. Thread-safe. It
/// outlives all Jobs.
class Background {
 public:
  /// Starts the threads of these lanes; those of others start with their first jobs. A server
  /// starts all before it runs, so that none inherits the scheduling of a prompt thread.
  explicit Background(std::span<const Lane> to_start = {});

  /// Returns after how long it is to run again; nothing: it is done. Exceptions are logged.
  using Work = std::function<std::optional<Clock::duration>(const std::stop_token& stop)>;
  using JobId = std::uint64_t;  // 0: none

  static constexpr std::size_t most_waiting = 1024;  // in a lane

  class Jobs;

 private:
  struct Job {
    JobId id = 0;
    const Jobs* owner;
    Priority priority;
    Work work;
    std::function<void()> on_cancelled;
    TimePoint due{};
    std::stop_source stop{};
    bool cancelled = false;
    bool closed = false;  // it does not run again
  };
  using SharedJob = std::shared_ptr<Job>;
  struct LaneState {
    explicit LaneState(const Lane& of) : lane(of) {}

    const Lane lane;
    std::list<SharedJob> waiting{};  // by priority, then by order
    std::list<SharedJob> running{};
    std::uint64_t changes = 0;  // of `waiting`
    std::condition_variable_any changed{};
    std::vector<std::jthread> threads{};
  };

  // The mutex is held.
  void start_thread(LaneState& lane);
  void enqueue(LaneState& lane, const SharedJob& job);
  SharedJob take(LaneState& lane);

  void serve(LaneState& lane, const std::stop_token& stop);
  std::optional<Clock::duration> run(const Lane& lane, Job& job);

  std::mutex mutex_;
  std::condition_variable ended_;  // a job
  JobId last_id_ = 0;
  std::map<std::string_view, LaneState> lanes_;
};

/// The jobs of one owner. They end with this object, so it is the owner's last member. Thread-safe.
class Background::Jobs {
 public:
  /// `io` runs the session thread, for start() with `then`.
  Jobs(Background& background, boost::asio::io_context& io) : background_(background), io_(&io) {}
  explicit Jobs(Background& background) : background_(background) {}
  ~Jobs() { end(); }
  Jobs(const Jobs&) = delete;
  Jobs& operator=(const Jobs&) = delete;

  /// `work(stop)` is Work, or returns nothing. `on_cancelled` is called where cancel() or a full
  /// lane kept the work from its end, and not for what close() drops. 0: too many wait, and the job
  /// is cancelled, or close() was called.
  template <typename Function>
  JobId start(const Lane& lane, Priority priority, Function work,
              std::function<void()> on_cancelled = {}) {
    if constexpr (std::is_void_v<std::invoke_result_t<Function&, const std::stop_token&>>) {
      return add(
          lane, priority,
          [work = std::move(work)](const std::stop_token& stop) mutable {
            work(stop);
            return std::optional<Clock::duration>();
          },
          std::move(on_cancelled));
    } else {
      return add(lane, priority, std::move(work), std::move(on_cancelled));
    }
  }
  /// Then calls `then(Finished)` with what `work(stop)` returned, on the session thread, unless the
  /// owner is gone or has closed its jobs.
  template <typename Function, typename Then>
  JobId start_then(const Lane& lane, Priority priority, Function work, Then then) {
    using Result = std::invoke_result_t<Function&, const std::stop_token&>;
    auto finish = [io = io_, owner = std::weak_ptr(alive_),
                   then = std::move(then)](Finished<Result> finished) {
      boost::asio::post(*io, [owner, then, finished = std::move(finished)]() mutable {
        if (!owner.expired()) then(std::move(finished));
      });
    };
    return start(
        lane, priority,
        [work = std::move(work), finish](const std::stop_token& stop) mutable {
          Finished<Result> finished;
          try {
            finished.result = work(stop);
          } catch (const std::exception& failure) {
            finished.error = failure.what();
          }
          finish(std::move(finished));
        },
        [finish] { finish({}); });
  }
  /// A job that has not begun is not run; the stop of one under way is requested.
  void cancel(JobId id);
  void set_priority(JobId id, Priority priority);
  /// Takes no more jobs, and drops those that wait. Those under way continue.
  void close();
  /// Also requests the stop of those under way, and waits for their end.
  void end();

 private:
  JobId add(const Lane& lane, Priority priority, Work work, std::function<void()> on_cancelled);

  Background& background_;
  boost::asio::io_context* const io_ = nullptr;
  bool closed_ = false;  // guarded by the mutex of background_
  std::shared_ptr<const bool> alive_ = std::make_shared<const bool>(true);
};

/// Runs `function` on the session thread, and returns its result. For work in the background.
/// Throws Cancelled once the stop is requested: `function` does not run after that.
template <typename Function>
auto ask_session_thread(boost::asio::io_context& io, const std::stop_token& stop,
                        Function function) {
  struct Question {
    std::mutex mutex{};
    std::condition_variable_any answered{};
    bool dropped = false;
    std::optional<std::invoke_result_t<Function&>> answer{};
  };
  const auto question = std::make_shared<Question>();
  boost::asio::post(io, [question, &function] {
    const std::lock_guard lock(question->mutex);
    if (question->dropped) return;
    question->answer = function();
    question->answered.notify_all();
  });
  std::unique_lock lock(question->mutex);
  question->dropped =
      !question->answered.wait(lock, stop, [&] { return question->answer.has_value(); });
  if (question->dropped) throw Cancelled();
  return std::move(*question->answer);
}

}  // namespace catgs

#include "server/base/background.h"

#include <algorithm>
#include <iterator>
#include <semaphore>

#include "server/base/log_event.h"
#include "server/base/prompt_thread.h"

namespace catgs {
namespace {

constexpr std::chrono::hours nothing_due{1};

}  // namespace

void sleep_unless_stopped(Clock::duration duration, const std::stop_token& stop) {
  std::binary_semaphore stopped(0);
  const std::stop_callback wake(stop, [&] { stopped.release(); });
  (void)stopped.try_acquire_for(duration);
}

Background::Background(std::span<const Lane> to_start) {
  const std::lock_guard lock(mutex_);
  for (const Lane& lane : to_start) {
    LaneState& state = lanes_.try_emplace(lane.name, lane).first->second;
    while (state.threads.size() < lane.threads) start_thread(state);
  }
}

void Background::start_thread(LaneState& lane) {
  lane.threads.emplace_back([this, &lane](const std::stop_token& stop) { serve(lane, stop); });
}

void Background::enqueue(LaneState& lane, const SharedJob& job) {
  const std::size_t known = lane.running.size() + lane.waiting.size() + 1;
  if (lane.threads.size() < std::min(lane.lane.threads, known)) start_thread(lane);  // may throw
  const auto behind = std::ranges::find_if(
      lane.waiting, [&](const SharedJob& other) { return other->priority < job->priority; });
  lane.waiting.insert(behind, job);
  ++lane.changes;
  lane.changed.notify_all();
  if (job->priority == Priority::low || lane.running.size() < lane.lane.threads) return;
  const auto low = std::ranges::find(lane.running, Priority::low, &Job::priority);
  if (low != lane.running.end()) (*low)->stop.request_stop();
}

/// The first job that is due; null: none is.
Background::SharedJob Background::take(LaneState& lane) {
  const TimePoint now = Clock::now();
  const auto next =
      std::ranges::find_if(lane.waiting, [&](const SharedJob& job) { return job->due <= now; });
  if (next == lane.waiting.end()) return nullptr;
  lane.running.splice(lane.running.end(), lane.waiting, next);
  return lane.running.back();
}

void Background::serve(LaneState& lane, const std::stop_token& stop) {
  if (lane.lane.in_background) run_in_background();
  std::unique_lock lock(mutex_);
  while (!stop.stop_requested()) {
    const SharedJob job = take(lane);
    if (!job) {
      TimePoint due = Clock::now() + nothing_due;
      for (const SharedJob& waits : lane.waiting) due = std::min(due, waits->due);
      lane.changed.wait_until(lock, stop, due,
                              [&, seen = lane.changes] { return lane.changes != seen; });
      continue;
    }
    lock.unlock();
    std::optional<Clock::duration> again = run(lane.lane, *job);
    lock.lock();
    if (!again || job->cancelled || job->closed) {
      const bool tell = again && job->on_cancelled;
      lock.unlock();
      if (tell) job->on_cancelled();
      job->work = nullptr;  // what it holds goes before the owner may
      job->on_cancelled = nullptr;
      lock.lock();
      again.reset();
    }
    lane.running.remove(job);
    ended_.notify_all();
    if (!again) continue;
    job->due = Clock::now() + *again;
    job->stop = {};
    enqueue(lane, job);
  }
}

/// A job that was stopped is to run again, unless its owner has cancelled it.
std::optional<Clock::duration> Background::run(const Lane& lane, Job& job) {
  try {
    return job.work(job.stop.get_token());
  } catch (const Cancelled&) {
    return Clock::duration::zero();
  } catch (const std::exception& failure) {
    log_error({.event = "background_failed"}, "{}: {}", lane.name, failure.what());
    return std::nullopt;
  }
}

Background::JobId Background::Jobs::add(const Lane& lane, Priority priority, Work work,
                                        std::function<void()> on_cancelled) {
  const auto job = std::make_shared<Job>(Job{.owner = this,
                                             .priority = priority,
                                             .work = std::move(work),
                                             .on_cancelled = std::move(on_cancelled)});
  {
    const std::lock_guard lock(background_.mutex_);
    LaneState& state = background_.lanes_.try_emplace(lane.name, lane).first->second;
    if (closed_) return 0;
    if (state.waiting.size() < most_waiting) {
      job->id = ++background_.last_id_;
      background_.enqueue(state, job);
      return job->id;
    }
  }
  if (job->on_cancelled) job->on_cancelled();
  return 0;
}

void Background::Jobs::cancel(JobId id) {
  SharedJob dropped;
  {
    const std::lock_guard lock(background_.mutex_);
    for (auto& [name, lane] : background_.lanes_) {
      if (const auto job = std::ranges::find(lane.running, id, &Job::id);
          job != lane.running.end()) {
        (*job)->cancelled = true;
        (*job)->stop.request_stop();
      }
      if (const auto job = std::ranges::find(lane.waiting, id, &Job::id);
          job != lane.waiting.end()) {
        dropped = *job;
        lane.waiting.erase(job);
      }
    }
  }
  if (dropped && dropped->on_cancelled) dropped->on_cancelled();
}

void Background::Jobs::set_priority(JobId id, Priority priority) {
  const std::lock_guard lock(background_.mutex_);
  for (auto& [name, lane] : background_.lanes_) {
    if (const auto job = std::ranges::find(lane.running, id, &Job::id); job != lane.running.end())
      (*job)->priority = priority;
    const auto waits = std::ranges::find(lane.waiting, id, &Job::id);
    if (waits == lane.waiting.end() || (*waits)->priority == priority) continue;
    const SharedJob job = *waits;
    lane.waiting.erase(waits);
    job->priority = priority;
    background_.enqueue(lane, job);
  }
}

void Background::Jobs::close() {
  std::list<SharedJob> dropped;  // goes when the mutex is free, as it may answer somebody
  const std::lock_guard lock(background_.mutex_);
  closed_ = true;
  for (auto& [name, lane] : background_.lanes_) {
    for (const SharedJob& job : lane.running) job->closed |= job->owner == this;
    for (auto job = lane.waiting.begin(); job != lane.waiting.end();) {
      const auto next = std::next(job);
      if ((*job)->owner == this) dropped.splice(dropped.end(), lane.waiting, job);
      job = next;
    }
  }
}

void Background::Jobs::end() {
  close();
  alive_.reset();
  std::unique_lock lock(background_.mutex_);
  for (auto& [name, lane] : background_.lanes_)
    for (const SharedJob& job : lane.running)
      if (job->owner == this) {
        job->cancelled = true;
        job->stop.request_stop();
      }
  background_.ended_.wait(lock, [&] {
    return std::ranges::none_of(background_.lanes_, [&](const auto& of) {
      return std::ranges::find(of.second.running, this, &Job::owner) != of.second.running.end();
    });
  });
}

}  // namespace catgs

#include "server/films/film_queue.h"

#include <algorithm>
#include <iterator>
#include <map>
#include <utility>

#include "server/access/signed_token.h"

namespace catgs {
namespace {

using Weight = std::function<std::uint64_t(const FilmJob& job)>;

/// Clears the ids of jobs until the others weigh no more than `most`: of the owner whose jobs weigh
/// most, the one that ended first. The one that ended last stays in any case.
void keep_within(std::vector<FilmJob>& jobs, std::uint64_t most, const Weight& weight) {
  while (true) {
    std::uint64_t sum = 0;
    std::map<std::string_view, std::uint64_t> of_owner;
    std::vector<FilmJob*> kept;
    for (FilmJob& job : jobs) {
      const std::uint64_t weighs = job.id.empty() ? 0 : weight(job);
      if (weighs == 0) continue;
      sum += weighs;
      of_owner[job.owner] += weighs;
      kept.push_back(&job);
    }
    if (sum <= most || kept.size() < 2) return;
    std::ranges::stable_sort(kept, {}, &FilmJob::changed);
    kept.pop_back();
    const auto share = [&](const FilmJob* job) { return of_owner.at(job->owner); };
    (*std::ranges::max_element(kept, {}, share))->id.clear();  // the first of several
  }
}

}  // namespace

bool has_ended(const FilmReport& job) {
  return job.state != FilmState::waiting && job.state != FilmState::drawing;
}

std::variant<std::string, FilmQueue::Refused> FilmQueue::add(std::string scene_id,
                                                             std::string owner,
                                                             FilmRequest request) {
  std::vector<FilmJob> old;
  const std::lock_guard lock(mutex_);
  old = drop_old();
  if (std::ranges::any_of(
          jobs_, [&](const FilmJob& job) { return job.owner == owner && !has_ended(job); }))
    return Refused{true};
  if (std::ranges::count(jobs_, FilmState::waiting, &FilmJob::state) >=
      static_cast<std::ptrdiff_t>(most_waiting))
    return Refused{false};
  const FilmReport report{.kind = request.kind, .owner = std::move(owner), .changed = clock_()};
  jobs_.push_back({report, random_id(), std::move(scene_id), std::move(request)});
  return jobs_.back().id;
}

void FilmQueue::found_scene(const std::string& id, int content) {
  const std::lock_guard lock(mutex_);
  if (FilmJob* const job = known(id)) job->content = content;
}

std::optional<FilmJob> FilmQueue::start_next() {
  const std::lock_guard lock(mutex_);
  const auto next = std::ranges::find(jobs_, FilmState::waiting, &FilmJob::state);
  if (next == jobs_.end()) return std::nullopt;
  next->state = FilmState::drawing;
  next->changed = clock_();
  std::vector<FilmView> views = std::move(next->request.views);  // whoever draws has them alone
  FilmJob started = *next;
  started.request.views = std::move(views);
  return started;
}

bool FilmQueue::drawn(const std::string& id, double share) {
  const std::lock_guard lock(mutex_);
  FilmJob* const job = known(id);
  if (!job || job->state != FilmState::drawing) return false;
  job->share = share;
  return true;
}

void FilmQueue::finish(const std::string& id, std::shared_ptr<const ResultFile> result) {
  std::vector<FilmJob> old;
  const std::lock_guard lock(mutex_);
  FilmJob* const job = known(id);
  if (!job || job->state != FilmState::drawing) return;
  job->result = std::move(result);
  job->share = 1.0;
  end(*job, FilmState::done);
  old = drop_old();
}

void FilmQueue::fail(const std::string& id, std::string why) {
  const std::lock_guard lock(mutex_);
  FilmJob* const job = known(id);
  if (!job || job->state != FilmState::drawing) return;
  job->error = std::move(why);
  end(*job, FilmState::failed);
}

bool FilmQueue::cancel(std::string_view id) {
  const std::lock_guard lock(mutex_);
  FilmJob* const job = known(id);
  if (!job || has_ended(*job)) return false;
  end(*job, FilmState::cancelled);
  return true;
}

std::optional<FilmReport> FilmQueue::find(std::string_view id) {
  std::vector<FilmJob> old;
  const std::lock_guard lock(mutex_);
  old = drop_old();
  const FilmJob* const job = known(id);
  return job ? std::optional<FilmReport>(*job) : std::nullopt;
}

std::optional<std::chrono::seconds> FilmQueue::left(const FilmReport& job) const {
  if (job.state != FilmState::drawing || job.share <= 0.0) return std::nullopt;
  const double so_far_s = std::chrono::duration<double>(clock_() - job.changed).count();
  return std::chrono::seconds(
      static_cast<std::int64_t>(so_far_s * (1.0 - job.share) / job.share + 0.5));
}

FilmJob* FilmQueue::known(std::string_view id) {
  const auto found = std::ranges::find(jobs_, id, &FilmJob::id);
  return found == jobs_.end() ? nullptr : &*found;
}

void FilmQueue::end(FilmJob& job, FilmState state) {
  job.state = state;
  std::vector<FilmView>().swap(job.request.views);
  job.changed = clock_();
}

std::vector<FilmJob> FilmQueue::drop_old() {
  const TimePoint now = clock_();
  for (FilmJob& job : jobs_)
    if (has_ended(job) && now - job.changed > kept_for) job.id.clear();
  keep_within(jobs_, most_results, [](const FilmJob& job) { return job.result ? 1u : 0u; });
  keep_within(jobs_, most_result_bytes,
              [](const FilmJob& job) { return job.result ? job.result->size() : 0; });
  keep_within(jobs_, most_without_result,
              [](const FilmJob& job) { return has_ended(job) && !job.result ? 1u : 0u; });
  const auto old =
      std::ranges::stable_partition(jobs_, [](const FilmJob& job) { return !job.id.empty(); });
  std::vector<FilmJob> dropped(std::make_move_iterator(old.begin()),
                               std::make_move_iterator(old.end()));
  jobs_.erase(old.begin(), old.end());
  return dropped;
}

}  // namespace catgs

#include "server/scenes/scene_memory.h"

#include <algorithm>
#include <utility>

#include <fmt/format.h>

#include "render_core/base/error.h"
#include "server/base/log_event.h"
#include "server/base/scene_id.h"
#include "server/scenes/scene_refusal.h"

namespace catgs {
namespace {

using namespace std::chrono_literals;

constexpr auto retry_after_failure = 30s;
constexpr std::size_t most_prepared = 2;
constexpr std::size_t most_unvisited = 2;

ResidencyLimits residency_limits(const ServerConfig& config) {
  constexpr std::uint64_t megabyte = 1'000'000;
  return {static_cast<std::uint64_t>(config.scene_memory_mb) * megabyte, tree_memory(config),
          std::chrono::seconds(config.scene_residency_s)};
}

}  // namespace

SceneMemory::SceneMemory(const ServerConfig& config, SceneIndex& index, SceneTrees& trees,
                         SceneLoader& loader, Metrics& metrics, std::function<TimePoint()> clock)
    : config_(config),
      index_(index),
      trees_(trees),
      loads_(loader),
      metrics_(metrics),
      clock_(std::move(clock)),
      residency_(residency_limits(config)),
      use_of_([this](const std::string& id) {
        const SceneRecord* const record = index_.find(id);
        return record ? record->use() : SceneUse::none;
      }),
      redrawing_(index_, trees_, residency_, loads_),
      posters_(
          index_, trees_, loads_, [this](SceneRecord& record) { load_for_poster(record); },
          [this] { publish(); }) {}

void SceneMemory::load_now(const std::string& id) {
  const FoundScene& found = index_.records().at(id).found;
  const TimePoint now = clock_();
  const auto answer = residency_.want(id, trees_.need_of(found), now, use_of_);
  if (answer != SceneResidency::Answer::awaited)
    throw InputError("--scene-memory", {}, refusal(answer, id, trees_.bytes_of(found)).message);
  residency_.next(now, use_of_);
  auto entry = loads_.load_now(found);
  on_loaded(found, {std::move(entry)}, now, clock_());
}

void SceneMemory::failed_now(const std::string& id, const std::string& error) {
  on_loaded(index_.records().at(id).found, {nullptr, error}, clock_(), clock_());
}

SceneAnswer SceneMemory::want(const std::string& id, TimePoint now) {
  std::erase_if(prepared_, [&](const Prepared& prepared) { return prepared.id == id; });
  std::erase(unvisited_, id);
  const SceneRecord& record = index_.records().at(id);
  if (record.entry) {
    residency_.note_use(id, now);
    return record.entry;
  }
  if (record.retry_at && now < *record.retry_at)
    return ErrorMessage{ErrorCode::unknown_scene,
                        fmt::format("the scene \"{}\" could not be loaded", name_in(id)), false};
  if (!trees_.representation_of(record.found)) {
    if (trees_.given_up(record.found))
      return refusal(SceneResidency::Answer::too_large, id, record.found.size.bytes());
    trees_.order(record.found, true);
    return SceneAwaited{trees_.estimate(record.found)};
  }
  const std::uint64_t bytes = trees_.bytes_of(record.found);
  const auto answer = residency_.want(id, trees_.need_of(record.found), now, use_of_);
  if (answer != SceneResidency::Answer::awaited) {
    if (!redrawing_.holds_two_representations()) return refusal(answer, id, bytes);
    redrawing_.give_way();
    return SceneAwaited{1s};  // one of them goes soon
  }
  redrawing_.give_way();
  if (residency_.visitor_waits() && residency_.loads_in_background()) loads_.give_way();
  start_next(now);
  const double seconds = static_cast<double>(bytes) / bytes_per_second_;
  return SceneAwaited{std::chrono::seconds(1 + static_cast<std::int64_t>(seconds))};
}

void SceneMemory::prepare(const std::string& id, TimePoint now) {
  const SceneRecord* const record = index_.find(id);
  if (!record || record->gone || record->entry || residency_.busy()) return;
  if (!trees_.representation_of(record->found)) return;
  std::erase_if(prepared_, [&](const Prepared& other) { return !residency_.resident(other.id); });
  if (prepared_.size() >= most_prepared) {
    const auto [oldest, since] = prepared_.front();
    if (use_of_(oldest) != SceneUse::none ||
        now - since < std::chrono::seconds(config_.scene_residency_s))
      return;
    release(oldest);
    prepared_.erase(prepared_.begin());
  }
  const SceneNeed need = trees_.need_of(record->found);
  while (!residency_.has_room(need) && !unvisited_.empty()) drop_unvisited();
  if (!residency_.has_room(need)) return;
  if (std::holds_alternative<SceneAwaited>(want(id, now))) prepared_.push_back({id, now});
}

void SceneMemory::on_tick(TimePoint now) {
  std::vector<std::string> outdated;
  for (const auto& [id, record] : index_.records()) {
    if (!record.entry || record.pinned) continue;
    const SceneUse use = record.use();
    if (use != SceneUse::none) residency_.note_use(id, now);
    if (use == SceneUse::visitors || !(record.outdated || record.gone)) continue;
    if (use == SceneUse::background)
      record.recall();
    else
      outdated.push_back(id);
  }
  for (const std::string& id : outdated) release(id);
  const auto [too_large, changed] = redrawing_.on_tick(now);
  for (const std::string& id : too_large) release(id);
  if (changed) publish();
  start_next(now);
}

void SceneMemory::start_next(TimePoint now) {
  const auto step = residency_.next(now, use_of_);
  if (!step) return;
  for (const std::string& id : step->recall) index_.records().at(id).recall();
  if (step->recall.empty()) carry_out(*step, SceneLoader::For::visitors, now);
}

void SceneMemory::load_for_poster(SceneRecord& record) {
  const std::string& id = record.found.id;
  const TimePoint now = clock_();
  const auto may_leave = [this](const std::string& other) {
    return std::ranges::find(unvisited_, other) == unvisited_.end() ? SceneUse::visitors
                                                                    : use_of_(other);
  };
  const auto step = residency_.next_in_background(id, trees_.need_of(record.found), now, may_leave);
  if (!step) return;
  if (unvisited_.size() >= most_unvisited && step->release.empty()) drop_unvisited();
  record.poster_tried = carry_out(*step, SceneLoader::For::jobs, now);
  if (record.poster_tried) unvisited_.push_back(id);
}

void SceneMemory::drop_unvisited() {
  const std::string id = unvisited_.front();
  unvisited_.erase(unvisited_.begin());
  if (residency_.resident(id) && use_of_(id) == SceneUse::none) release(id);
}

bool SceneMemory::carry_out(const SceneResidency::Step& step, SceneLoader::For whom,
                            TimePoint now) {
  for (const std::string& id : step.release) release(id);
  const FoundScene& found = index_.records().at(step.load).found;
  const auto representation = trees_.representation_of(found);
  if (!representation) {
    residency_.failed(step.load);  // its tree was lost; visitors ask again
    return false;
  }
  loads_.load(found, *representation, whom, [this, found, now](LoadedScene loaded) {
    on_loaded(found, std::move(loaded), now, clock_());
  });
  return true;
}

/// The next scene finds the memory free.
void SceneMemory::release(const std::string& id) {
  SceneRecord& record = index_.records().at(id);
  log_info({.event = "scene_released", .scene = id}, "scene {} released", id);
  metrics_.scenes_released.Increment();
  residency_.drop(id);
  std::erase(unvisited_, id);
  auto entry = std::exchange(record.entry, nullptr);
  record.walkable_area.reset();
  record.outdated = record.tree_lost = false;
  if (record.gone) index_.records().erase(id);
  publish();
  loads_.free_later(std::move(entry));
}

void SceneMemory::on_loaded(const FoundScene& found, LoadedScene loaded, TimePoint started,
                            TimePoint now) {
  const std::string& id = found.id;
  SceneRecord* const record = index_.find(id);
  const bool other_tree = record && record->found.tree != found.tree;
  if (!loaded.entry || !record) {
    residency_.failed(id);
    std::erase(unvisited_, id);
    if (record && (loaded.gave_way || loaded.unusable_tree)) record->poster_tried = false;
    if (loaded.gave_way) return start_next(now);
    if (loaded.unusable_tree) {
      if (!other_tree) trees_.discard(found, loaded.error);
      return start_next(now);  // visitors ask again
    }
    log_error({.event = "scene_load_failed", .scene = id}, "scene {} is not loaded: {}", id,
              loaded.error);
    metrics_.scene_loads_failed.Increment();
    if (record) record->retry_at = now + retry_after_failure;
    return start_next(now);
  }
  const SceneNeed need = need_of(*loaded.entry);
  const double seconds = std::chrono::duration<double>(now - started).count();
  if (!loaded.entry->in_pages)
    bytes_per_second_ =
        std::max(1e6, static_cast<double>(trees_.bytes_of(record->found)) / std::max(seconds, 0.1));
  metrics_.scenes_loaded.Increment();
  residency_.loaded(id, need, now);
  record->entry = std::move(loaded.entry);
  // Files are read as they are, and a tree is of the files before.
  record->outdated = other_tree && record->entry->in_pages;
  record->walkable_area = record->outdated ? std::make_shared<const WalkableArea>() : nullptr;
  publish();
  start_next(now);
}

LeasedScene SceneMemory::lease(const std::string& id, bool again) {
  const SceneRecord* const record = index_.find(id);
  if (!record) return {.gone = true};
  const LeasedScene none{.gone = record->gone};
  if (record->entry) {
    // While a visitor needs the room, no scene is held that visitors have left.
    const bool leaves = record->outdated || record->gone || residency_.visitor_waits();
    return leaves && !record->pinned && record->use() != SceneUse::visitors ? none
                                                                            : record->lease();
  }
  const TimePoint now = clock_();
  if (!again || record->gone || (record->retry_at && now < *record->retry_at) ||
      !trees_.representation_of(record->found))
    return none;
  const auto step = residency_.next_in_background(id, trees_.need_of(record->found), now, use_of_);
  if (!step) return none;
  carry_out(*step, SceneLoader::For::jobs, now);
  return none;
}

void SceneMemory::publish() {
  index_.publish([this](const FoundScene& found) { return trees_.state_of(found); });
  metrics_.scenes_in_memory.Set(static_cast<double>(residency_.count()));
  metrics_.scene_bytes.Set(static_cast<double>(residency_.bytes()));
}

}  // namespace catgs

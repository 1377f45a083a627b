#include "server/scenes/scene_residency.h"

#include <algorithm>
#include <iterator>
#include <utility>

namespace catgs {

void SceneResidency::pin(const std::string& id, const SceneNeed& need) {
  residents_.insert_or_assign(id, Resident{need, true, {}, {}});
}

SceneResidency::Answer SceneResidency::want(const std::string& id, const SceneNeed& need,
                                            TimePoint now, const UseOf& use_of) {
  if (resident(id)) {
    note_use(id, now);
    return Answer::resident;
  }
  if (loading_ == id) in_background_ = false;
  if (awaited(id)) return Answer::awaited;
  if (!could_fit(need)) return Answer::too_large;
  if (!room_for(need, [&](const auto& other, const Resident&) {
        return use_of(other) != SceneUse::visitors;
      }))
    return Answer::no_room;
  // A load for a background job gives way soon. Until then, each who asks again has to wait.
  if (waiting_) return in_background_ ? Answer::awaited : Answer::busy;
  waiting_ = {id, need};
  return Answer::awaited;
}

std::optional<SceneResidency::Step> SceneResidency::next(TimePoint now, const UseOf& use_of) {
  if (!waiting_ || !loading_.empty()) return std::nullopt;
  const auto may_go = [&](const std::string& id, const Resident&) {
    return use_of(id) != SceneUse::visitors;
  };
  if (!room_for(waiting_->need, may_go)) {
    // A scene to release came into use. Waiting clients ask again and get an answer.
    waiting_.reset();
    return std::nullopt;
  }
  auto release = room_for(waiting_->need, [&](const std::string& id, const Resident& resident) {
    return may_go(id, resident) && now - resident.since >= limits_.min_residency;
  });
  if (!release) return std::nullopt;
  Step recalls;
  std::ranges::copy_if(*release, std::back_inserter(recalls.recall),
                       [&](const std::string& id) { return use_of(id) == SceneUse::background; });
  if (!recalls.recall.empty()) return recalls;
  return begin(std::exchange(waiting_, std::nullopt)->id, *std::move(release), false);
}

std::optional<SceneResidency::Step> SceneResidency::next_in_background(const std::string& id,
                                                                       const SceneNeed& need,
                                                                       TimePoint now,
                                                                       const UseOf& use_of) {
  if (busy() || resident(id)) return std::nullopt;
  auto release = room_for(need, [&](const std::string& other, const Resident& resident) {
    return use_of(other) == SceneUse::none &&
           now - std::max(resident.since, resident.last_use) >= limits_.min_residency;
  });
  return release ? std::optional(begin(id, *std::move(release), true)) : std::nullopt;
}

SceneResidency::Step SceneResidency::begin(const std::string& id, std::vector<std::string> release,
                                           bool in_background) {
  for (const std::string& gone : release) residents_.erase(gone);
  loading_ = id;
  in_background_ = in_background;
  return {std::move(release), id};
}

void SceneResidency::loaded(const std::string& id, const SceneNeed& need, TimePoint now) {
  loading_.clear();
  // One that was loaded for a background job goes first as soon as a visitor needs the room.
  const auto since = std::exchange(in_background_, false) ? now - limits_.min_residency : now;
  residents_.insert_or_assign(id, Resident{need, false, since, since});
}

void SceneResidency::failed(const std::string& id) {
  if (loading_ != id) return;
  loading_.clear();
  in_background_ = false;
}

void SceneResidency::note_use(const std::string& id, TimePoint now) {
  if (const auto it = residents_.find(id); it != residents_.end()) it->second.last_use = now;
}

std::uint64_t SceneResidency::bytes() const { return bytes_without({}, false); }

std::uint64_t SceneResidency::bytes_without(const std::vector<std::string>& gone,
                                            bool pool_stays) const {
  std::uint64_t sum = 0;
  bool has_pool = pool_stays;
  for (const auto& [id, resident] : residents_) {
    if (std::ranges::find(gone, id) != gone.end()) continue;
    sum += resident.need.bytes;
    has_pool = has_pool || resident.need.in_pages;
  }
  return sum + (has_pool ? limits_.pool_bytes : 0);
}

bool SceneResidency::fits(const std::vector<std::string>& gone, const SceneNeed& need) const {
  const auto stays = [&](const auto& resident) {
    return resident.second.need.in_pages && std::ranges::find(gone, resident.first) == gone.end();
  };
  if (need.in_pages &&
      std::ranges::count_if(residents_, stays) >= std::ptrdiff_t{most_scenes_in_pages})
    return false;
  return limits_.budget_bytes == 0 ||
         bytes_without(gone, need.in_pages) + need.bytes <= limits_.budget_bytes;
}

std::optional<std::vector<std::string>> SceneResidency::room_for(
    const SceneNeed& need,
    const std::function<bool(const std::string&, const Resident&)>& may_go) const {
  std::vector<std::string> leaving;
  std::vector<const std::pair<const std::string, Resident>*> candidates;
  for (const auto& entry : residents_)
    if (!entry.second.pinned && may_go(entry.first, entry.second)) candidates.push_back(&entry);
  std::ranges::sort(candidates, {}, [](const auto* entry) { return entry->second.last_use; });
  for (const auto* entry : candidates) {
    if (fits(leaving, need)) break;
    leaving.push_back(entry->first);
  }
  if (!fits(leaving, need)) return std::nullopt;
  // Scenes in pages make no room while others keep the pool.
  std::vector<std::string> whole;
  for (const std::string& id : leaving)
    if (!residents_.at(id).need.in_pages) whole.push_back(id);
  return fits(whole, need) ? whole : leaving;
}

}  // namespace catgs

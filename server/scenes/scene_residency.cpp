#include "server/scenes/scene_residency.h"

#include <algorithm>
#include <utility>

namespace catgs {

void SceneResidency::pin(const std::string& id, std::uint64_t bytes) {
  residents_[id] = {bytes, true, {}, {}};
}

SceneResidency::Wish SceneResidency::want(const std::string& id, std::uint64_t bytes, TimePoint now,
                                          const InUse& in_use) {
  if (resident(id)) {
    note_use(id, now);
    return Wish::resident;
  }
  if (awaited(id)) return Wish::awaited;
  if (!room_for(bytes, [](const auto&, const Resident&) { return true; })) return Wish::too_large;
  if (!room_for(bytes, [&](const auto& other, const Resident&) { return !in_use(other); }))
    return Wish::no_room;
  if (waiting_) return Wish::busy;
  waiting_ = {id, bytes};
  return Wish::awaited;
}

std::optional<SceneResidency::Step> SceneResidency::next(TimePoint now, const InUse& in_use) {
  if (!waiting_ || !loading_.empty()) return std::nullopt;
  const auto unused = [&](const std::string& id, const Resident&) { return !in_use(id); };
  if (!room_for(waiting_->bytes, unused)) {
    // A scene to release came into use. Waiting clients ask again and are told.
    waiting_.reset();
    return std::nullopt;
  }
  auto release = room_for(waiting_->bytes, [&](const std::string& id, const Resident& resident) {
    return unused(id, resident) && now - resident.since >= limits_.min_residency;
  });
  if (!release) return std::nullopt;
  for (const std::string& id : *release) residents_.erase(id);
  loading_ = std::exchange(waiting_, std::nullopt)->id;
  return Step{*std::move(release), loading_};
}

void SceneResidency::loaded(const std::string& id, std::uint64_t bytes, TimePoint now) {
  loading_.clear();
  residents_[id] = {bytes, false, now, now};
}

void SceneResidency::failed(const std::string& id) {
  if (loading_ == id) loading_.clear();
}

void SceneResidency::note_use(const std::string& id, TimePoint now) {
  if (const auto it = residents_.find(id); it != residents_.end()) it->second.last_use = now;
}

std::uint64_t SceneResidency::bytes() const {
  std::uint64_t sum = 0;
  for (const auto& [id, resident] : residents_) sum += resident.bytes;
  return sum;
}

std::optional<std::vector<std::string>> SceneResidency::room_for(
    std::uint64_t bytes,
    const std::function<bool(const std::string&, const Resident&)>& may_go) const {
  std::vector<std::string> leaving;
  if (limits_.budget_bytes == 0) return leaving;
  std::vector<const std::pair<const std::string, Resident>*> candidates;
  for (const auto& entry : residents_)
    if (!entry.second.pinned && may_go(entry.first, entry.second)) candidates.push_back(&entry);
  std::ranges::sort(candidates, {}, [](const auto* entry) { return entry->second.last_use; });
  std::uint64_t taken = this->bytes();
  for (const auto* entry : candidates) {
    if (taken + bytes <= limits_.budget_bytes) break;
    taken -= entry->second.bytes;
    leaving.push_back(entry->first);
  }
  if (taken + bytes > limits_.budget_bytes) return std::nullopt;
  return leaving;
}

}  // namespace catgs

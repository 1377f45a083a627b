#include "server/scenes/scene_index.h"

#include <algorithm>
#include <utility>

#include "server/base/log_event.h"
#include "server/base/scene_id.h"

namespace catgs {

SceneUse SceneRecord::use() const {
  // Leases are counted before holders. A lease that ends in between makes the scene look less used,
  // and then it is still held: it does not go.
  const int leased = leases->held;
  if (held(entry, leased) || held(former, leased)) return SceneUse::visitors;
  return held(entry, 0) || former ? SceneUse::background : SceneUse::none;
}

SceneRecord* SceneIndex::find(const std::string& id) {
  const auto it = records_.find(id);
  return it == records_.end() ? nullptr : &it->second;
}

SceneRecord& SceneIndex::record_of(const std::string& id) {
  const auto [record, is_new] = records_.try_emplace(id);
  if (is_new) {
    const std::lock_guard lock(published_mutex_);
    const auto [known, first] = by_name_.try_emplace(std::string(name_in(id)), id);
    if (!first && known->second != id) known->second.clear();
  }
  return record->second;
}

void SceneIndex::merge(std::vector<FoundScene> found,
                       const std::function<bool(const std::string& id)>& awaited) {
  for (auto& [id, record] : records_) record.gone = !record.pinned;
  for (FoundScene& scene : found) {
    SceneRecord& record = record_of(scene.id);
    if (record.pinned) continue;  // --scene names it, too
    record.gone = false;
    if (record.found.stamp != scene.stamp) {
      record.outdated = record.entry != nullptr;
      ++record.content;
      record.poster.reset();
      record.poster_tried = false;
      // Visitors still see the former scene, and no file tells its walkable area any more.
      record.walkable_area = record.entry ? std::make_shared<const WalkableArea>() : nullptr;
      record.retry_at.reset();
    } else {
      scene.about = std::move(record.found.about);  // authors may have saved it since
    }
    record.found = std::move(scene);
  }
  for (auto& [id, record] : records_) {
    const std::string name(name_in(id));
    if (record.pinned || record.told || !by_name_.at(name).empty()) continue;
    record.told = true;
    log_info({.event = "scene_named", .scene = id}, "scene {} is {}, one of several called \"{}\"",
             id, record.found.location.given.string(), name);
  }
  // Scenes in memory are released first, once they are unused.
  std::erase_if(records_, [&](const auto& of) {
    return of.second.gone && !of.second.entry && !awaited(of.first);
  });
}

std::vector<std::string> SceneIndex::scene_ids() const {
  std::vector<std::string> ids;
  for (const auto& [id, record] : records_)
    if (!record.gone) ids.push_back(id);
  // Newcomers see the first one.
  if (const auto it = std::ranges::find(ids, preferred_); it != ids.end())
    std::rotate(ids.begin(), it, it + 1);
  return ids;
}

std::string SceneIndex::resolve(std::string_view name) const {
  if (!belongs_to_path(name)) {
    const std::lock_guard lock(published_mutex_);
    if (const auto known = by_name_.find(name); known != by_name_.end() && !known->second.empty())
      return known->second;
  }
  return std::string(name);
}

std::vector<ScenePages> SceneIndex::pages() const {
  std::vector<ScenePages> all;
  for (const auto& [id, record] : records_)
    if (record.entry)
      for (const PageFigures& figures : record.entry->renderer->pages())
        all.push_back({id, figures});
  return all;
}

void SceneIndex::publish(const std::function<std::string(const FoundScene&)>& state_of) {
  auto listing = std::make_shared<std::vector<SceneListing>>();
  for (const std::string& id : scene_ids()) {
    SceneRecord& record = records_.at(id);
    if (record.entry && !record.outdated) {
      record.found.about = record.entry->facts.about;
      record.poster = record.entry->poster;
    }
    const FoundScene& found = record.found;
    listing->push_back({.id = id,
                        .title = found.about.title.empty() ? found.name : found.about.title,
                        .gaussians = found.size.gaussians,
                        .about = found.about,
                        .loaded = record.entry != nullptr,
                        .state = state_of(found),
                        .poster = record.poster});
    listing->back().walkable_area = record.walkable_area;
    if (!record.entry) continue;
    listing->back().tours = record.entry->tours;
    listing->back().sidecar = record.entry->sidecar;
  }
  const std::lock_guard lock(published_mutex_);
  published_ = std::move(listing);
}

std::shared_ptr<const std::vector<SceneListing>> SceneIndex::listing() const {
  const std::lock_guard lock(published_mutex_);
  return published_;
}

}  // namespace catgs

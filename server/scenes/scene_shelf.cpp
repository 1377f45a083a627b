#include "server/scenes/scene_shelf.h"

#include <algorithm>
#include <utility>

#include "server/base/log_event.h"
#include "server/base/scene_id.h"

namespace catgs {

SceneUse SceneBook::use() const {
  // Leases are counted before holders. A lease that ends in between makes the scene look less used,
  // and then it is still held: it does not go.
  const int leased = leases->held;
  if (held(entry, leased) || held(former, leased)) return SceneUse::visitors;
  return held(entry, 0) || former ? SceneUse::background : SceneUse::none;
}

SceneBook* SceneShelf::find(const std::string& id) {
  const auto it = books_.find(id);
  return it == books_.end() ? nullptr : &it->second;
}

SceneBook& SceneShelf::book_of(const std::string& id) {
  const auto [book, is_new] = books_.try_emplace(id);
  if (is_new) {
    const std::lock_guard lock(published_mutex_);
    const auto [known, first] = by_name_.try_emplace(std::string(name_in(id)), id);
    if (!first && known->second != id) known->second.clear();
  }
  return book->second;
}

void SceneShelf::merge(std::vector<FoundScene> found,
                       const std::function<bool(const std::string& id)>& awaited) {
  for (auto& [id, book] : books_) book.gone = !book.pinned;
  for (FoundScene& scene : found) {
    SceneBook& book = book_of(scene.id);
    if (book.pinned) continue;  // --scene names it, too
    book.gone = false;
    if (book.found.changed != scene.changed) {
      book.outdated = book.entry != nullptr;
      ++book.content;
      book.poster.reset();
      book.poster_tried = false;
      // Visitors still see the former scene, and no file tells its ground any more.
      book.ground = book.entry ? std::make_shared<const SceneGround>() : nullptr;
      book.retry_at.reset();
    }
    book.found = std::move(scene);
  }
  for (auto& [id, book] : books_) {
    const std::string name(name_in(id));
    if (book.pinned || book.told || !by_name_.at(name).empty()) continue;
    book.told = true;
    log_info({.event = "scene_named", .scene = id}, "scene {} is {}, one of several called \"{}\"",
             id, book.found.location.given.string(), name);
  }
  // Scenes in memory are released first, once they are unused.
  std::erase_if(books_, [&](const auto& of) {
    return of.second.gone && !of.second.entry && !awaited(of.first);
  });
}

std::string SceneShelf::default_scene() const {
  const auto preferred = books_.find(preferred_);
  if (preferred != books_.end() && !preferred->second.gone) return preferred_;
  const auto other = std::ranges::find_if(books_, [](const auto& of) { return !of.second.gone; });
  return other != books_.end() ? other->first : std::string();
}

std::vector<std::string> SceneShelf::scene_ids() const {
  std::vector<std::string> ids;
  for (const auto& [id, book] : books_)
    if (!book.gone) ids.push_back(id);
  // Newcomers see the default scene first.
  if (const auto it = std::ranges::find(ids, default_scene()); it != ids.end())
    std::rotate(ids.begin(), it, it + 1);
  return ids;
}

std::string SceneShelf::resolve(std::string_view name) const {
  if (!belongs_to_path(name)) {
    const std::lock_guard lock(published_mutex_);
    if (const auto known = by_name_.find(name); known != by_name_.end() && !known->second.empty())
      return known->second;
  }
  return std::string(name);
}

std::vector<ScenePages> SceneShelf::pages() const {
  std::vector<ScenePages> all;
  for (const auto& [id, book] : books_)
    if (book.entry)
      for (const PageFigures& figures : book.entry->renderer->pages()) all.push_back({id, figures});
  return all;
}

void SceneShelf::publish(const std::function<std::string(const FoundScene&)>& state_of) {
  auto listing = std::make_shared<std::vector<SceneListing>>();
  for (const std::string& id : scene_ids()) {
    SceneBook& book = books_.at(id);
    if (book.entry && !book.outdated) {
      book.found.about = book.entry->facts.about;
      book.poster = book.entry->poster;
    }
    const FoundScene& found = book.found;
    listing->push_back({.id = id,
                        .title = found.about.title.empty() ? found.name : found.about.title,
                        .gaussians = found.size.gaussians,
                        .about = found.about,
                        .loaded = book.entry != nullptr,
                        .state = state_of(found),
                        .poster = book.poster});
    listing->back().ground = book.ground;
    if (!book.entry) continue;
    listing->back().tours = book.entry->tours;
    listing->back().sidecar = book.entry->sidecar;
  }
  const std::lock_guard lock(published_mutex_);
  published_ = std::move(listing);
}

std::shared_ptr<const std::vector<SceneListing>> SceneShelf::listing() const {
  const std::lock_guard lock(published_mutex_);
  return published_;
}

}  // namespace catgs

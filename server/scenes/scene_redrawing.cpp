#include "server/scenes/scene_redrawing.h"

#include <algorithm>
#include <utility>

#include "server/base/log_event.h"
#include "server/scenes/poster.h"

namespace catgs {
namespace {

using namespace std::chrono_literals;

// Visitors who wait for memory ask again before.
constexpr auto retry_after_giving_way = 10s;

/// True if pages of the scene's tree in the cache could not be read.
bool reads_damaged_tree(const SceneRecord& record) {
  return !record.found.tree.empty() && record.entry->in_pages &&
         std::ranges::any_of(record.entry->renderer->pages(),
                             [](const PageFigures& figures) { return figures.unreadable > 0; });
}

}  // namespace

std::shared_ptr<const SceneEntry> SceneRedrawing::newer_representation(
    const SceneEntry& seen) const {
  const auto record = index_.records().find(seen.facts.scene_id);
  if (record == index_.records().end()) return nullptr;
  const auto& former = record->second.former;
  return former && former->renderer == seen.renderer ? record->second.entry : nullptr;
}

bool SceneRedrawing::holds_two_representations() const {
  return busy_ || std::ranges::any_of(index_.records(),
                                      [](const auto& of) { return of.second.former != nullptr; });
}

SceneRedrawing::Tick SceneRedrawing::on_tick(TimePoint now) {
  Tick tick;
  if (std::exchange(gave_way_, false)) retry_at_ = now + retry_after_giving_way;
  if (retry_at_ && now >= *retry_at_) retry_at_.reset();
  for (auto& [id, record] : index_.records()) {
    if (record.former_is_left()) {
      loader_.free_later(std::exchange(record.former, nullptr));
      residency_.resize(id, need_of(*record.entry));
      changed_ = true;
    }
    const FoundScene& found = record.found;
    // Where visitors still see the representation before, another one waits.
    if (!record.entry || record.former || record.outdated || record.gone) continue;
    if (!record.tree_lost && reads_damaged_tree(record)) {
      trees_.discard(found, "pages are damaged");
      record.tree_lost = true;  // what is left of it is drawn until there is another
    }
    const bool wants_tree = record.entry->in_pages
                                ? record.tree_lost
                                : (record.entry->coarse || trees_.deserves_one(found)) &&
                                      trees_.choices().of(found) != TreeChoices::Choice::without;
    if (!wants_tree && record.entry->in_pages && trees_.undecided(found) &&
        residency_.has_room(trees_.need_of(found, false)))
      start(id);
    if (!wants_tree || trees_.given_up(found)) continue;
    if (!trees_.ready(found))
      trees_.order(found, false);
    else if (residency_.has_room(trees_.need_of(found)))
      start(id);
    else if (!record.pinned && record.use() == SceneUse::none)
      tick.too_large.push_back(id);  // its next visitor gets the tree
  }
  changed_ |= trees_.on_tick(now);
  tick.changed = std::exchange(changed_, false);
  return tick;
}

void SceneRedrawing::start(const std::string& id) {
  if (busy_ || retry_at_ || residency_.busy()) return;
  busy_ = true;
  const SceneRecord& record = *index_.find(id);
  const SceneEntry& before = *record.entry;
  const bool to_tree = !before.in_pages || record.tree_lost;
  residency_.resize(id, need_of(before).with(trees_.need_of(record.found, to_tree)));
  SceneLoader::Present present;
  if (!record.tree_lost) present = {before.renderer, !before.in_pages && !before.coarse};
  // Pages are missing to those who look at a damaged tree.
  const auto whom = record.tree_lost ? SceneLoader::For::visitors : SceneLoader::For::jobs;
  const auto load = loader_.load_beside(
      std::move(present), record.found, *trees_.representation_of(record.found, to_tree), whom,
      [this, id, found = record.found, renderer = before.renderer](LoadedScene loaded) {
        on_loaded(id, found, std::move(loaded), renderer);
      });
  if (whom == SceneLoader::For::jobs) gives_way_ = load;
}

void SceneRedrawing::on_loaded(const std::string& id, const FoundScene& found, LoadedScene loaded,
                               const std::shared_ptr<Renderer>& before) {
  busy_ = false;
  SceneRecord* const record = index_.find(id);
  if (record && record->entry) residency_.resize(id, need_of(*record->entry));
  gave_way_ = loaded.gave_way;
  if (loaded.gave_way) return;
  if (loaded.unusable_tree) return trees_.discard(found, loaded.error);
  if (!loaded.entry && record && record->entry && record->entry->in_pages && !record->tree_lost)
    return trees_.choices().take_tree(found, loaded.error);
  if (!loaded.entry) return trees_.give_up(found, loaded.error);
  const bool still_wanted = record && record->entry && record->entry->renderer == before &&
                            record->found.tree == found.tree && !record->outdated;
  if (!still_wanted) return loader_.free_later(std::move(loaded.entry));
  // Visitors' places are about the origin that their welcome named.
  if (loaded.entry->facts.origin != record->entry->facts.origin) {
    loader_.free_later(std::move(loaded.entry));
    constexpr const char* why = "it has another origin than the scene in memory";
    if (record->entry->in_pages && !record->tree_lost)
      return trees_.choices().take_tree(found, why);
    return trees_.give_up(found, why);
  }
  if (loaded.compared) trees_.choices().decide(found, *loaded.compared);
  if (loaded.compared && loaded.compared->tree_is_good() != loaded.entry->in_pages)
    return loader_.free_later(std::move(loaded.entry));
  residency_.resize(id, need_of(*record->entry).with(need_of(*loaded.entry)));
  auto drawn = redrawn(*record->entry, *loaded.entry);
  // An author may have saved another first view since the load began.
  if (same_poster(drawn->facts, loaded.entry->facts)) drawn->poster = loaded.entry->poster;
  record->former = std::exchange(record->entry, std::move(drawn));
  record->tree_lost = false;
  record->recall();  // jobs continue with the new representation
  changed_ = true;
  log_info({.event = "scene_redrawn", .scene = id}, "scene {} is drawn {} from now on", id,
           record->entry->in_pages ? "from its tree" : "without its tree");
}

}  // namespace catgs

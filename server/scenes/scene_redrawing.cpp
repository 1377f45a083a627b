#include "server/scenes/scene_redrawing.h"

#include <algorithm>
#include <utility>

#include "server/base/log_event.h"

namespace catgs {
namespace {

/// True if pages of the scene's tree in the cache could not be read.
bool reads_damaged_tree(const SceneBook& book) {
  return !book.found.tree.empty() && book.entry->in_pages &&
         std::ranges::any_of(book.entry->renderer->pages(),
                             [](const PageFigures& figures) { return figures.unreadable > 0; });
}

}  // namespace

std::shared_ptr<const SceneEntry> SceneRedrawing::newer_form(const SceneEntry& seen) const {
  const auto book = shelf_.books().find(seen.facts.scene_id);
  if (book == shelf_.books().end()) return nullptr;
  const auto& former = book->second.former;
  return former && former->renderer == seen.renderer ? book->second.entry : nullptr;
}

bool SceneRedrawing::holds_two_forms() const {
  return busy_ || std::ranges::any_of(shelf_.books(),
                                      [](const auto& of) { return of.second.former != nullptr; });
}

SceneRedrawing::Tick SceneRedrawing::on_tick(TimePoint now) {
  Tick tick;
  for (auto& [id, book] : shelf_.books()) {
    if (book.former_is_left()) {
      loader_.free_later(std::exchange(book.former, nullptr));
      residency_.resize(id, need_of(*book.entry));
      changed_ = true;
    }
    const FoundScene& found = book.found;
    // Where visitors still see the form before, another one waits.
    if (!book.entry || book.former || book.outdated || book.gone) continue;
    if (!book.tree_lost && reads_damaged_tree(book)) {
      trees_.discard(found, "pages are damaged");
      book.tree_lost = true;  // what is left of it is drawn until there is another
    }
    const bool wants_tree =
        book.entry->in_pages ? book.tree_lost : book.entry->coarse || trees_.deserves_one(found);
    if (!wants_tree || trees_.given_up(found)) continue;
    if (!trees_.ready(found))
      trees_.order(found, false);
    else if (residency_.has_room(trees_.need_of(found)))
      start(id);
    else if (!book.pinned && book.use() == SceneUse::none)
      tick.too_large.push_back(id);  // its next visitor gets the tree
  }
  changed_ |= trees_.on_tick(now);
  tick.changed = std::exchange(changed_, false);
  return tick;
}

void SceneRedrawing::start(const std::string& id) {
  if (busy_ || residency_.busy()) return;
  busy_ = true;
  const SceneBook& book = *shelf_.find(id);
  residency_.resize(id, need_of(*book.entry).with(trees_.need_of(book.found)));
  loader_.load(book.found, *trees_.form_of(book.found), SceneLoader::For::visitors,
               [this, id, found = book.found, before = book.entry->renderer](LoadedScene loaded) {
                 on_loaded(id, found, std::move(loaded), before);
               });
}

void SceneRedrawing::on_loaded(const std::string& id, const FoundScene& found, LoadedScene loaded,
                               const std::shared_ptr<Renderer>& before) {
  busy_ = false;
  SceneBook* const book = shelf_.find(id);
  if (book && book->entry) residency_.resize(id, need_of(*book->entry));
  if (loaded.unusable_tree) return trees_.discard(found, loaded.error);
  if (!loaded.entry) return trees_.give_up(found, loaded.error);
  const bool still_wanted = book && book->entry && book->entry->renderer == before &&
                            book->found.tree == found.tree && !book->outdated;
  if (!still_wanted) return loader_.free_later(std::move(loaded.entry));
  residency_.resize(id, need_of(*book->entry).with(need_of(*loaded.entry)));
  book->former = std::exchange(book->entry, redrawn(*book->entry, *loaded.entry));
  book->tree_lost = false;
  book->recall();  // jobs go on with the new form
  changed_ = true;
  log_info({.event = "scene_redrawn", .scene = id}, "scene {} is drawn from its tree from now on",
           id);
}

}  // namespace catgs

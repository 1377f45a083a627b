#include "server/scenes/scene_posters.h"

#include <memory>

namespace catgs {

void ScenePosters::want(const std::string& id) {
  SceneBook* const book = shelf_.find(id);
  if (!book || busy_ || residency_.busy()) return;
  const auto form = trees_.form_of(book->found);
  if (!form || book->gone || book->entry || book->poster || book->poster_tried ||
      !residency_.has_room(trees_.need_of(book->found)))
    return;
  start(*book, *form);
}

void ScenePosters::start(SceneBook& book, const SceneForm& form) {
  busy_ = book.poster_tried = true;
  loader_.load_poster(book.found, form,
                      [this, id = book.found.id, changed = book.found.changed](const auto& poster) {
                        busy_ = false;
                        SceneBook* const made_for = shelf_.find(id);
                        if (!made_for || made_for->found.changed != changed) return;
                        if (!poster) made_for->poster_tried = false;
                        if (poster && !made_for->poster) made_for->poster = *poster;
                        changed_();
                      });
}

}  // namespace catgs

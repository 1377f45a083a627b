#include "server/scenes/scene_posters.h"

#include <memory>

#include <boost/asio/post.hpp>

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
  boost::asio::post(loader_, [this, form, found = book.found] {
    // The scene goes here, on the loader's thread: that may wait for the device.
    std::shared_ptr<const std::string> poster;
    const LoadedScene loaded = load_(found, form);
    if (loaded.entry) poster = loaded.entry->poster;
    boost::asio::post(
        io_, [this, id = found.id, changed = found.changed, poster, gave_way = loaded.gave_way] {
          busy_ = false;
          SceneBook* const made_for = shelf_.find(id);
          if (!made_for || made_for->found.changed != changed) return;
          if (gave_way) made_for->poster_tried = false;
          if (!made_for->poster) made_for->poster = poster;
          changed_();
        });
  });
}

}  // namespace catgs

#include "server/scenes/scene_posters.h"

#include <memory>

namespace catgs {

void ScenePosters::want(const std::string& id) {
  SceneRecord* const record = index_.find(id);
  if (!record || busy_ || residency_.busy()) return;
  const auto representation = trees_.representation_of(record->found);
  if (!representation || record->gone || record->entry || record->poster || record->poster_tried ||
      !residency_.has_room(trees_.need_of(record->found)))
    return;
  start(*record, *representation);
}

void ScenePosters::start(SceneRecord& record, const SceneRepresentation& representation) {
  busy_ = record.poster_tried = true;
  loader_.load_poster(
      record.found, representation,
      [this, id = record.found.id, changed = record.found.changed](const auto& poster) {
        busy_ = false;
        SceneRecord* const made_for = index_.find(id);
        if (!made_for || made_for->found.changed != changed) return;
        if (!poster) made_for->poster_tried = false;
        if (poster && !made_for->poster) made_for->poster = *poster;
        changed_();
      });
}

}  // namespace catgs

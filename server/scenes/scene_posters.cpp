#include "server/scenes/scene_posters.h"

namespace catgs {

void ScenePosters::want(const std::string& id) {
  const auto lacks_poster = [](const SceneRecord* record) {
    return record && !record->gone && !record->entry && !record->poster && !record->poster_tried;
  };
  const SceneRecord* const record = index_.find(id);
  if (reads_ || !lacks_poster(record)) return;
  const auto representation = trees_.representation_of(record->found);
  if (!representation) return;
  reads_ = true;
  loader_.read_poster(record->found, *representation,
                      [this, id, lacks_poster, stamp = record->found.stamp](const auto& kept) {
                        reads_ = false;
                        SceneRecord* const read_for = index_.find(id);
                        if (!lacks_poster(read_for) || read_for->found.stamp != stamp) return;
                        if (!kept) return load_(*read_for);
                        read_for->poster = kept;
                        changed_();
                      });
}

}  // namespace catgs

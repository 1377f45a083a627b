#pragma once

#include <string>

#include "render_core/base/printable.h"
#include "render_core/scene/analysis/enclosure.h"
#include "render_core/scene/scene.h"
#include "server/net/messages.h"

namespace catgs {

/// Takes over what is hinted. `name`: of the scene, which is its title where its author gives none.
/// `surface`: the scene's; null: it is not known whether the start is enclosed.
inline void use_hints(const SceneHints& hints, const std::string& name,
                      const SurfacePoints* surface, SceneFacts& facts) {
  facts.title = hints.about.title.empty() ? printable(name) : hints.about.title;
  facts.up = hints.up;
  facts.start_pose = hints.start_pose;
  facts.focus = hints.focus;
  facts.limits_min = hints.limits.min;
  facts.limits_max = hints.limits.max;
  facts.near_z = hints.near_z;
  facts.scale = hints.scale;
  facts.origin = hints.origin;
  facts.up_is_doubtful = hints.up_is_doubtful;
  facts.start_enclosed = surface != nullptr && is_start_enclosed(*surface, hints);
  facts.about = hints.about;
}

/// The hints that use_hints() took over.
inline SceneHints hints_of(const SceneFacts& facts) {
  SceneHints hints;
  hints.up = facts.up;
  hints.start_pose = facts.start_pose;
  hints.focus = facts.focus;
  hints.limits = {facts.limits_min, facts.limits_max};
  hints.near_z = facts.near_z;
  hints.scale = facts.scale;
  hints.origin = facts.origin;
  hints.up_is_doubtful = facts.up_is_doubtful;
  hints.about = facts.about;
  return hints;
}

}  // namespace catgs

#pragma once

#include <nlohmann/json_fwd.hpp>

#include "render_core/scene/edit/edit_scene.h"
#include "render_core/scene/files/hints.h"

namespace catgs {

/// The "tours" of the sidecar; null if there are none. Throws InputError for a
/// file that is no JSON.
nlohmann::ordered_json tours_in_sidecar(const HintFiles& files);

/// Places all that lies in the scene: members "position", "look_at" and "marker" of three numbers,
/// and "orientation" of four, at any depth. Everything else stays, known or not, and so do the
/// places of portals, which are in other scenes. `origin`: of the placed scene.
void place_tours(nlohmann::ordered_json& tours, const Placement& placement,
                 const glm::dvec3& origin = glm::dvec3(0.0));

}  // namespace catgs

#pragma once

#include <nlohmann/json_fwd.hpp>

#include "render_core/scene/edit/edit_scene.h"
#include "render_core/scene/files/hints.h"

namespace catgs {

/// The fields of the sidecar that are for pages: "tours" and "measures", those that are there.
/// Throws InputError for a file that is no JSON.
nlohmann::ordered_json page_fields_in_sidecar(const HintFiles& files);

/// Places all that lies in the scene: members "position", "look_at" and "marker" of three numbers,
/// and "orientation" of four, at any depth, "section" and "view_height" of stops, and "error" and
/// "depth" of measures. Everything else stays, known or not, and so do the places of portals, which
/// are in other scenes. `hints`: of the placed scene.
void place_tours(nlohmann::ordered_json& tours, const Placement& placement,
                 const SceneHints& hints = {});

}  // namespace catgs

#pragma once

#include <cstdint>
#include <string>

#include <fmt/format.h>

#include "server/base/scene_id.h"
#include "server/net/messages.h"
#include "server/scenes/scene_residency.h"

namespace catgs {

/// Tells a visitor why a scene that takes so many bytes is not loaded.
inline ErrorMessage refusal(SceneResidency::Answer answer, const std::string& id,
                            std::uint64_t bytes) {
  if (answer == SceneResidency::Answer::too_large)
    return {ErrorCode::unknown_scene,
            fmt::format("the scene \"{}\" needs {:.1f} MB, more than --scene-memory allows",
                        name_in(id), 1e-6 * static_cast<double>(bytes)),
            false};
  if (answer == SceneResidency::Answer::no_room)
    return {
        ErrorCode::server_full,
        fmt::format("there is no memory for \"{}\" while others look at other scenes: try again "
                    "in a minute",
                    name_in(id)),
        false};
  return {ErrorCode::server_full, "other scenes are being loaded: try again in a minute", false};
}

}  // namespace catgs

#pragma once

#include <memory>
#include <string>

#include <glm/vec2.hpp>

#include "render_core/frame/renderer.h"
#include "server/net/messages.h"

namespace catgs {

inline constexpr glm::ivec2 poster_size_px{960, 540};

/// Renders the scene's first view as a JPEG, for waiting pages and link previews. Returns null and
/// logs the error if that fails; pages then show no poster.
std::shared_ptr<const std::string> make_poster(Renderer& renderer, const SceneFacts& facts);

/// True if both descriptions give the same poster.
bool same_poster(const SceneFacts& one, const SceneFacts& other);

}  // namespace catgs

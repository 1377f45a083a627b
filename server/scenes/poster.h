#pragma once

#include <functional>
#include <memory>
#include <string>

#include <glm/vec2.hpp>

#include "render_core/frame/renderer.h"
#include "server/net/messages.h"

namespace catgs {

using Poster = std::shared_ptr<const std::string>;  // a JPEG file; null: none
/// Returns the poster that was kept, or that of `make`, which is kept from then on.
using KeepPoster = std::function<Poster(const std::function<Poster()>& make)>;

inline constexpr glm::ivec2 poster_size_px{960, 540};

/// Renders the scene's first view as a JPEG, for waiting pages and link previews. Returns null and
/// logs the error if that fails; pages then show no poster.
Poster make_poster(Renderer& renderer, const SceneFacts& facts);

/// True if both descriptions give the same poster.
bool same_poster(const SceneFacts& one, const SceneFacts& other);

}  // namespace catgs

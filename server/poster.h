#pragma once

#include <memory>
#include <string>

#include <glm/vec2.hpp>

#include "render_core/renderer.h"
#include "server/net/messages.h"

namespace catgs {

inline constexpr glm::ivec2 poster_size_px{960, 540};

/// The scene from where a visit begins, as a JPEG file, for pages that wait and for links in
/// messengers. Null, with a line in the log, where it cannot be made: then pages show none.
std::shared_ptr<const std::string> make_poster(Renderer& renderer, const SceneFacts& facts);

}  // namespace catgs

#pragma once

#include <memory>
#include <string>

#include "render_core/renderer.h"
#include "server/net/messages.h"

namespace catgs {

/// The scene from where a visit begins, as a JPEG file of 960x540, for pages that wait. Null, with
/// a line in the log, where it cannot be made: then pages show none.
std::shared_ptr<const std::string> make_poster(Renderer& renderer, const SceneFacts& facts);

}  // namespace catgs

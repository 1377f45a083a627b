#pragma once

#include <memory>
#include <string>
#include <vector>

#include "server/config.h"
#include "server/session/session.h"

namespace catgs {

/// Loads every scene of the configuration once and builds its renderer, as `core` says (with its
/// pool); all sessions share it. Throws InputError: one bad scene is an operator's mistake, not
/// something to serve around.
std::vector<std::shared_ptr<const SceneEntry>> load_scenes(const ServerConfig& config,
                                                           const RendererOptions& core);

/// Encoders that the probe found usable and `--encoder` admits, best first. Throws InputError when
/// there is none. A named encoder still leaves JPEG for clients without a video decoder.
std::vector<EncoderChoice> usable_encoders(EncoderKind wanted,
                                           const std::vector<EncoderProbe>& probes);

}  // namespace catgs

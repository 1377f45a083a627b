#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "server/config.h"
#include "server/session/session.h"

namespace catgs {

/// Loads one scene: a path, or synth:KIND:COUNT[:SEED], and builds its renderer as `core` says
/// (with its pool). `id_of` makes its id of its name; `threads` read it; `progress` is called now
/// and then, and may throw to give up. Throws InputError.
std::shared_ptr<const SceneEntry> load_scene(
    const std::string& spec, const std::function<std::string(const std::string& name)>& id_of,
    const ServerConfig& config, const RendererOptions& core, int threads,
    const std::function<void(double)>& progress = {});

/// Loads every scene of the configuration once; all sessions share it. Throws InputError: one bad
/// scene is an operator's mistake, not something to serve around.
std::vector<std::shared_ptr<const SceneEntry>> load_scenes(const ServerConfig& config,
                                                           const RendererOptions& core);

/// Encoders that the probe found usable and `--encoder` admits, best first. Throws InputError when
/// there is none. A named encoder still leaves JPEG for clients without a video decoder.
std::vector<EncoderChoice> usable_encoders(EncoderKind wanted,
                                           const std::vector<EncoderProbe>& probes);

}  // namespace catgs

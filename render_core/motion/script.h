#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "render_core/motion/trajectory.h"
#include "render_core/scene/scene.h"

namespace catgs {

/// The parameters of a scripted pose stream. It is deterministic for (script, seed, scene hints) on
/// every machine.
struct ScriptOptions {
  std::string script;  // orbit | walk | head | drone | still | tour:FILE
  std::uint64_t seed = 1;
  double duration_s = 10.0;
  double rate_hz = 120.0;
};

/// The file of a tour's keyframes; empty for other scripts. Throws InputError where it is missing.
std::optional<std::string_view> tour_file(std::string_view script);

/// Poses at `rate_hz`, first one at time 0, inside the scene's limits. `head` has the statistics of
/// recorded head motion (median 20-40, p99 90-200 deg/s). Throws InputError on an unknown script.
Trajectory make_script(const ScriptOptions& options, const SceneHints& hints);

}  // namespace catgs

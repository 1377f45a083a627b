#pragma once

#include <optional>

#include "render_core/scene/gaussian_cloud.h"
#include "render_core/scene/scene.h"

namespace catgs::walk {

/// The eye height of a person (world units) for whom the room around the scene's start has a usual
/// height: 0.62 of it, as 1.6 m are of 2.6 m. A capture has no unit, so nothing else tells. Floor
/// and ceiling are the heights at which most level Gaussians lie around the start, below and above
/// it. Empty where there is no floor, or little of a ceiling. `sample`: an even sample is enough.
std::optional<float> estimate_eye_height(const GaussianCloud& sample, const SceneHints& hints);

/// The eye height (world units) of a person whose eyes are 1.6 m high, where the hints say how long
/// a unit is. Else as estimated.
std::optional<float> eye_height_of(const GaussianCloud& sample, const SceneHints& hints);

}  // namespace catgs::walk

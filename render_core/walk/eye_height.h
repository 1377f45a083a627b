#pragma once

#include <vector>

#include "render_core/scene/gaussian_cloud.h"
#include "render_core/scene/scene.h"

namespace catgs::walk {

/// Eye heights that a person may have in the scene (world units), the likeliest first; at most
/// three. One where the hints say how long a unit is: 1.6 m. Else they follow the heights of rooms,
/// 0.62 of each, as 1.6 m are of 2.6 m. A capture has no unit, so nothing else tells. The rooms of
/// the whole scene vote by their area, and the room around the start, if there is one, follows.
/// Empty where there are no rooms. `sample`: an even one is enough.
std::vector<float> eye_heights_of(const GaussianCloud& sample, const SceneHints& hints);

}  // namespace catgs::walk

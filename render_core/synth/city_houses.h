#pragma once

#include "render_core/synth/city_plan.h"
#include "render_core/synth/painter.h"

namespace catgs::synth {

/// Facades, roofs and what stands on them. `detail` is the density of Gaussians relative to places
/// that visitors walk through; `haze` is the share of haze in front.
void paint_building(Painter& painter, const Building& building, float detail, float haze);

}  // namespace catgs::synth

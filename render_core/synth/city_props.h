#pragma once

#include "render_core/synth/city_plan.h"
#include "render_core/synth/painter.h"

namespace catgs::synth {

/// Cars, street lamps and passers-by of a block's streets.
void paint_props(Painter& painter, const Block& block, float haze);

}  // namespace catgs::synth

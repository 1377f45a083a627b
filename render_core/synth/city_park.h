#pragma once

#include "render_core/synth/city_plan.h"
#include "render_core/synth/painter.h"

namespace catgs::synth {

/// The ground inside a block: courts, squares, a park's lawns, paths and pond.
void paint_lot(Painter& painter, const Block& block, float haze);

}  // namespace catgs::synth

#pragma once

#include "render_core/synth/city_plan.h"
#include "render_core/synth/painter.h"

namespace catgs::synth {

/// Road, markings, kerbs and pavements of the streets west and south of a block and the crossing
/// where they meet.
void paint_streets(Painter& painter, const Block& block, float haze);

}  // namespace catgs::synth

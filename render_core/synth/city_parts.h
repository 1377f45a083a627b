#pragma once

#include "render_core/synth/city_plan.h"
#include "render_core/synth/painter.h"

namespace catgs::synth {

/// Facades, roofs and what stands on them. `detail` is the density of Gaussians relative to places
/// that visitors walk through; `haze` is the share of haze in front.
void paint_building(Painter& painter, const Building& building, float detail, float haze);
/// The ground inside a block: courts, squares, a park's lawns, paths and pond.
void paint_lot(Painter& painter, const Block& block, float haze);
/// Cars, street lamps and passers-by of a block's streets.
void paint_props(Painter& painter, const Block& block, float haze);
/// Road, markings, kerbs and pavements of the streets west and south of a block and the crossing
/// where they meet.
void paint_streets(Painter& painter, const Block& block, float haze);

}  // namespace catgs::synth

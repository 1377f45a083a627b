#pragma once

#include <cstddef>

#include "render_core/tools/render_setup.h"

namespace catgs {

/// Mean squared error of the rendered rgb_f32 frame `i` of the path against the reference, at
/// `count` random pixels (the same for the same frame of the path).
double reference_error(const RenderSetup& setup, std::size_t i, const FrameView& frame,
                       std::size_t count);

}  // namespace catgs

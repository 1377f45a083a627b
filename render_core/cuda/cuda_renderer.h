#pragma once

#include <memory>
#include <string>

#include "render_core/renderer.h"

namespace catgs {

/// The CUDA core on device `device`. Throws InputError when the device cannot be used or the scene
/// does not fit.
std::unique_ptr<Renderer> make_cuda_renderer(const GaussianCloud& cloud, int device = 0);

/// Why no CUDA device can be used ("no NVIDIA driver", …); empty when one can.
std::string cuda_obstacle();

}  // namespace catgs

#pragma once

#include <memory>
#include <string>

#include "render_core/base/device_set.h"
#include "render_core/base/thread_pool.h"
#include "render_core/frame/device_error.h"
#include "render_core/frame/renderer.h"

namespace catgs {

/// The CUDA core, with a copy of the scene on each of `devices`. If all devices are wanted, the
/// reason names those that were left out. Throws InputError when a wanted device does not exist, or
/// in a build without the core. Throws DevicesUnusable when a wanted device cannot be used, or, if
/// all are wanted, when none can. `pool` packs the scene.
MadeRenderer make_cuda_renderer(const GaussianCloud& cloud, std::shared_ptr<DeviceSet> devices,
                                ThreadPool& pool);

/// The same for a scene in pages, with the memory for pages from the options.
MadeRenderer make_cuda_renderer(std::shared_ptr<TreeFile> tree, const RendererOptions& options,
                                std::shared_ptr<DeviceSet> devices);

/// Why no CUDA device can be used ("no CUDA device", …); empty when one can.
std::string cuda_obstacle();

}  // namespace catgs

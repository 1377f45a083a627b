#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "render_core/base/device_set.h"
#include "render_core/frame/renderer.h"

namespace catgs {

/// Makes a View on the least loaded of `devices` (not empty) on which `make` throws no DeviceError.
/// A failed device loses its Views and so would look like the best place for the next. Where `make`
/// fails on all devices, throws out_of_memory if any of them did, because such a device still
/// serves others; otherwise throws the last error.
std::unique_ptr<View> place_view(
    DeviceSet& set, std::vector<int> devices,
    const std::function<std::unique_ptr<View>(DeviceSet::Slot slot)>& make);

}  // namespace catgs

#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "render_core/base/device_set.h"
#include "render_core/renderer.h"

namespace catgs {

/// A View on the least loaded of `devices` (not empty) on which `make` throws no DeviceError: a
/// device that has failed loses its Views and would look like the best place for the next. Where it
/// fails on all, throws out_of_memory if one said so, which serves others, else what the last said.
std::unique_ptr<View> place_view(
    DeviceSet& set, std::vector<int> devices,
    const std::function<std::unique_ptr<View>(DeviceSet::Place place)>& make);

}  // namespace catgs

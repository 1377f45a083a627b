#include "render_core/cuda/place_view.h"

#include <cassert>
#include <optional>
#include <utility>

#include "render_core/frame/device_error.h"

namespace catgs {

std::unique_ptr<View> place_view(
    DeviceSet& set, std::vector<int> devices,
    const std::function<std::unique_ptr<View>(DeviceSet::Slot slot)>& make) {
  assert(!devices.empty());
  std::optional<DeviceError> full;
  for (;;) {
    DeviceSet::Slot slot = set.take(devices);
    const int index = slot.device();
    try {
      return make(std::move(slot));
    } catch (const DeviceError& error) {
      if (error.status_code() == RenderStatus::Code::out_of_memory) full = error;
      std::erase(devices, index);
      if (!devices.empty()) continue;
      if (full) throw DeviceError(*full);
      throw;
    }
  }
}

}  // namespace catgs

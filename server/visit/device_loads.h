#pragma once

#include <map>
#include <optional>
#include <span>

namespace catgs {

/// A session that renders on a device.
struct DeviceSession {
  int device = 0;
  std::optional<double> load;  // share of the device's time; nothing: not measured yet
};

/// The load that sessions put on each device, for DeviceSet::set_loads(). A session without a
/// measured load counts as the mean of the others. Pure.
inline std::map<int, double> device_loads(std::span<const DeviceSession> sessions) {
  double known = 0.0;
  int measured = 0;
  for (const DeviceSession& session : sessions) {
    known += session.load.value_or(0.0);
    measured += session.load ? 1 : 0;
  }
  const double mean = measured > 0 ? known / measured : 1.0;
  std::map<int, double> loads;
  for (const DeviceSession& session : sessions)
    loads[session.device] += session.load.value_or(mean);
  return loads;
}

}  // namespace catgs

#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace catgs {

/// Which CUDA devices Renderers use, and how many Views live on each. Renderers that share one (a
/// server's, one per scene) spread their Views together. Knows no CUDA. Thread-safe.
class DeviceSet : public std::enable_shared_from_this<DeviceSet> {
 public:
  /// Indices as CUDA numbers the devices that it sees; empty: all that can be used.
  explicit DeviceSet(std::vector<int> wanted = {0}) : wanted_(std::move(wanted)) {}

  [[nodiscard]] bool all() const { return wanted_.empty(); }
  /// The wanted ones where devices 0 to count - 1 are. Throws InputError when one is missing.
  [[nodiscard]] std::vector<int> among(int count) const;

  /// A View's place on a device; its end gives it back.
  class Place {
   public:
    Place(Place&& other) noexcept = default;
    ~Place();
    [[nodiscard]] int device() const { return device_; }

   private:
    friend class DeviceSet;
    Place(std::shared_ptr<DeviceSet> set, int device, std::uint64_t measurement)
        : set_(std::move(set)), device_(device), measurement_(measurement) {}
    std::shared_ptr<DeviceSet> set_;  // null: moved from
    int device_;
    std::uint64_t measurement_;  // the last one before it
  };
  /// A place on the least loaded of `devices` (not empty). Views whose load nobody has told count
  /// as much as the others do on average, so that without set_loads() it is the device with the
  /// fewest; among equally loaded ones it is that too, then the first.
  [[nodiscard]] Place take(std::span<const int> devices);
  /// How much the Views of each device were measured to keep it busy lately, in devices: 0.5 is
  /// half of its time. A device that is not named is idle.
  void set_loads(std::map<int, double> loads);

  /// Has `device` counted by views() from now on, Views or none.
  void add(int device);
  /// Live Views by device.
  [[nodiscard]] std::map<int, int> views() const;

 private:
  const std::vector<int> wanted_;
  mutable std::mutex mutex_;
  std::map<int, int> views_;
  std::map<int, double> loads_;
  std::map<int, int> views_since_;  // live ones that are not in them yet
  double mean_load_ = 1.0;          // of a View
  std::uint64_t measurements_ = 0;
};

/// The value of a flag --device: "all" -> {}, "0,2" -> {0, 2}. Throws std::invalid_argument.
std::vector<int> parse_devices(std::string_view text);
/// The same backwards.
std::string devices_text(std::span<const int> devices);

}  // namespace catgs

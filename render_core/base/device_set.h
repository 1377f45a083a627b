#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace catgs {

/// Which CUDA devices Renderers use, and how many Views live on each. Renderers that share a set
/// (one per scene of a server) spread their Views over it together. Contains no CUDA. Thread-safe.
class DeviceSet : public std::enable_shared_from_this<DeviceSet> {
 public:
  /// Takes the indices by which CUDA numbers the devices that it sees; empty: all usable ones.
  explicit DeviceSet(std::vector<int> wanted = {0}) : wanted_(std::move(wanted)) {}

  [[nodiscard]] bool all() const { return wanted_.empty(); }
  /// The wanted ones of the devices 0 to count - 1. Throws InputError when one is missing.
  [[nodiscard]] std::vector<int> among(int count) const;

  /// A View's slot on a device; its destructor gives it back.
  class Slot {
   public:
    Slot(int device, std::function<void()> give_back)
        : device_(device), give_back_(std::move(give_back)) {}
    Slot(Slot&& other) noexcept
        : device_(other.device_), give_back_(std::exchange(other.give_back_, nullptr)) {}
    ~Slot() {
      if (give_back_) give_back_();
    }
    [[nodiscard]] int device() const { return device_; }

   private:
    int device_;
    std::function<void()> give_back_;  // empty: moved from
  };
  /// A slot on the least loaded of `devices` (not empty). A View without a measured load counts as
  /// much as the average View. Without set_loads() the choice is therefore the device with the
  /// fewest Views. Equal loads are decided by the fewest Views, then by the order of `devices`.
  [[nodiscard]] Slot take(std::span<const int> devices);
  /// Sets the measured load of each device: the share of its time that its Views kept it busy
  /// lately, 0.5 for half. Devices that are not named count as idle.
  void set_loads(std::map<int, double> loads);

  /// Makes views() list `device` from now on, even without Views.
  void add(int device);
  /// Live Views by device.
  [[nodiscard]] std::map<int, int> views() const;

 private:
  /// Ends a Slot on `device` that was taken after so many set_loads().
  void give_back(int device, std::uint64_t measurement);

  const std::vector<int> wanted_;
  mutable std::mutex mutex_;
  std::map<int, int> views_;
  std::map<int, double> loads_;
  std::map<int, int> views_since_;  // live Views taken since then, not yet measured
  double mean_load_ = 1.0;          // of a View
  std::uint64_t measurements_ = 0;
};

/// Parses the value of --device: "all" -> {}, "0,2" -> {0, 2}. Throws std::invalid_argument.
std::vector<int> parse_devices(std::string_view text);
/// The inverse of parse_devices().
std::string devices_text(std::span<const int> devices);

}  // namespace catgs

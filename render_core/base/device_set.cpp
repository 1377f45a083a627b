#include "render_core/base/device_set.h"

#include <algorithm>
#include <cassert>
#include <charconv>
#include <stdexcept>

#include "render_core/base/error.h"

namespace catgs {
namespace {

int parse_index(std::string_view text, std::string_view whole) {
  int index = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), index);
  if (error != std::errc() || end != text.data() + text.size() || index < 0) {
    throw std::invalid_argument("\"" + std::string(whole) +
                                "\" is neither all nor a list of device numbers like 0 or 0,1");
  }
  return index;
}

}  // namespace

std::vector<int> DeviceSet::among(int count) const {
  std::vector<int> devices = wanted_;
  if (all()) {
    for (int index = 0; index < count; ++index) devices.push_back(index);
  }
  for (const int index : devices) {
    if (index < count) continue;
    throw InputError("--device " + devices_text(wanted_), "",
                     "there is no CUDA device " + std::to_string(index),
                     count == 1 ? "device 0 is the only one here"
                                : "devices 0 to " + std::to_string(count - 1) + " are here");
  }
  return devices;
}

void DeviceSet::give_back(int device, std::uint64_t measurement) {
  const std::lock_guard lock(mutex_);
  --views_[device];
  if (measurement == measurements_) --views_since_[device];
}

DeviceSet::Slot DeviceSet::take(std::span<const int> devices) {
  assert(!devices.empty());
  const std::lock_guard lock(mutex_);
  const auto load = [this](int index) {
    return std::pair(loads_[index] + mean_load_ * views_since_[index], views_[index]);
  };
  const int device = *std::ranges::min_element(devices, {}, load);
  ++views_[device];
  ++views_since_[device];
  return {device, [set = shared_from_this(), device, measurement = measurements_] {
            set->give_back(device, measurement);
          }};
}

void DeviceSet::set_loads(std::map<int, double> loads) {
  const std::lock_guard lock(mutex_);
  double all_loads = 0.0;
  int all_views = 0;
  for (const auto& [device, load] : loads) all_loads += load;
  for (const auto& [device, views] : views_) all_views += views;
  ++measurements_;
  loads_ = std::move(loads);
  views_since_.clear();
  mean_load_ = all_views > 0 ? all_loads / all_views : 1.0;
}

void DeviceSet::add(int device) {
  const std::lock_guard lock(mutex_);
  views_.try_emplace(device, 0);
}

std::map<int, int> DeviceSet::views() const {
  const std::lock_guard lock(mutex_);
  return views_;
}

std::vector<int> parse_devices(std::string_view text) {
  std::vector<int> devices;
  if (text == "all") return devices;
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t end = std::min(text.find(',', begin), text.size());
    const int index = parse_index(text.substr(begin, end - begin), text);
    if (std::ranges::find(devices, index) != devices.end()) {
      throw std::invalid_argument("\"" + std::string(text) + "\" names device " +
                                  std::to_string(index) + " twice");
    }
    devices.push_back(index);
    begin = end + 1;
  }
  return devices;
}

std::string devices_text(std::span<const int> devices) {
  std::string text;
  for (const int index : devices)
    text.append(text.empty() ? "" : ",").append(std::to_string(index));
  return text.empty() ? "all" : text;
}

}  // namespace catgs

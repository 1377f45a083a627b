#include "server/net/upload_slots.h"

#include <algorithm>

namespace catgs {

std::shared_ptr<UploadSlot> UploadSlots::take(const std::string& link, const std::string& address) {
  const std::lock_guard lock(mutex_);
  std::erase_if(taken_, [](const Taken& one) { return one.slot.expired(); });
  const auto taken_by = [&](const std::string& sender, std::string Taken::*member) {
    return static_cast<std::size_t>(std::ranges::count(taken_, sender, member));
  };
  if (taken_.size() >= bounds_.all || taken_by(link, &Taken::link) >= bounds_.of_a_link ||
      taken_by(address, &Taken::address) >= bounds_.of_an_address)
    return nullptr;
  auto slot = std::make_shared<UploadSlot>();
  taken_.push_back({link, address, slot});
  return slot;
}

std::size_t UploadSlots::taken() const {
  const std::lock_guard lock(mutex_);
  return static_cast<std::size_t>(
      std::ranges::count_if(taken_, [](const Taken& one) { return !one.slot.expired(); }));
}

}  // namespace catgs

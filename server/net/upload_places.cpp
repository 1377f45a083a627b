#include "server/net/upload_places.h"

#include <algorithm>

namespace catgs {

std::shared_ptr<UploadPlace> UploadPlaces::take(const std::string& link) {
  const std::lock_guard lock(mutex_);
  std::erase_if(taken_, [](const Taken& one) { return one.place.expired(); });
  const auto of_this_link =
      static_cast<std::size_t>(std::ranges::count(taken_, link, &Taken::link));
  if (taken_.size() >= most_ || of_this_link >= most_of_a_link_) return nullptr;
  auto place = std::make_shared<UploadPlace>();
  taken_.push_back({link, place});
  return place;
}

std::size_t UploadPlaces::taken() const {
  const std::lock_guard lock(mutex_);
  return static_cast<std::size_t>(
      std::ranges::count_if(taken_, [](const Taken& one) { return !one.place.expired(); }));
}

}  // namespace catgs

#include "render_core/cuda/frame_room.h"

#include <algorithm>
#include <limits>

namespace catgs::cuda {
namespace {

constexpr std::uint32_t patience = 600;  // key frames

}  // namespace

Room::Room(std::uint64_t first_guess, std::uint64_t limit)
    : ceiling_(static_cast<std::uint32_t>(
          std::min<std::uint64_t>(limit, std::numeric_limits<std::uint32_t>::max()))),
      limit_(ceiling_),
      size_(static_cast<std::uint32_t>(std::min<std::uint64_t>(first_guess, limit_))) {}

std::uint32_t Room::with_margin(std::uint32_t needed) const {
  return static_cast<std::uint32_t>(
      std::min<std::uint64_t>(std::uint64_t{needed} + needed / 8 + 4096, limit_));
}

bool Room::outgrown_by(std::uint32_t needed) {
  const bool grows = needed > size_ && size_ < limit_;
  if (grows) size_ = with_margin(needed);
  most_ = std::max(most_, needed);
  if (++frames_ == patience) {
    if (most_ <= size_ / 2) size_ = std::min(size_, with_margin(most_));
    limit_ = ceiling_;
    frames_ = most_ = 0;
  }
  return grows;
}

void Room::shrink_to(double part) {
  size_ = limit_ = static_cast<std::uint32_t>(part * size_);
  frames_ = most_ = 0;
}

FrameRoom::FrameRoom(std::uint32_t gaussians, std::uint64_t list_limit, bool splits)
    : visible_(gaussians / 4 + 1, std::max(gaussians, 1u)),
      lists_(gaussians + 65536ull, std::max<std::uint64_t>(list_limit, 1)),
      slices_(4096, splits ? std::numeric_limits<std::uint32_t>::max() : 0) {}

FrameSizes FrameRoom::sizes() const { return {visible_.size(), lists_.size(), slices_.size()}; }

bool FrameRoom::outgrown_by(const FrameSizes& needed) {
  slices_.outgrown_by(needed.slices);  // without them the frame was slower, not wrong
  const bool more_visible = visible_.outgrown_by(needed.visible);
  const bool longer_lists = lists_.outgrown_by(needed.list_entries);
  return more_visible || longer_lists;
}

bool FrameRoom::retreat() {
  constexpr std::uint32_t little = 1u << 16;
  if (slices_.size() > 0) {
    slices_.shrink_to(0.0);
  } else if (lists_.size() > little) {
    lists_.shrink_to(0.75);
  } else {
    return false;
  }
  return true;
}

}  // namespace catgs::cuda

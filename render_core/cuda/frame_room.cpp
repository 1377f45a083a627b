#include "render_core/cuda/frame_room.h"

#include <algorithm>
#include <cassert>
#include <limits>
#include <utility>

namespace catgs::cuda {
namespace {

constexpr int patience = 600;  // key frames

// Unused room for lists costs threads; unused room for slices costs nothing.
constexpr int lists_span = 240;
constexpr int slices_span = 600;

// The first room of a large scene. Its first drawing tells how much of the scene is in view; the
// second tells how long its lists are.
constexpr std::uint64_t first_visible = 1u << 18, first_entries = 1u << 20;

}  // namespace

Room::Room(std::uint64_t first_guess, std::uint64_t limit, int span)
    : ceiling_(static_cast<std::uint32_t>(
          std::min<std::uint64_t>(limit, std::numeric_limits<std::uint32_t>::max()))),
      limit_(ceiling_),
      size_(static_cast<std::uint32_t>(std::min<std::uint64_t>(first_guess, limit_))),
      span_(span) {
  assert(span > 0);
}

std::uint32_t Room::with_margin(std::uint32_t needed) const {
  return static_cast<std::uint32_t>(
      std::min<std::uint64_t>(std::uint64_t{needed} + needed / 8 + 4096, limit_));
}

bool Room::outgrown_by(std::uint32_t needed) {
  const bool lacked = needed > size_ && size_ < limit_;
  // Grows before the margin is used up, because a frame that lacks room is drawn twice.
  if (needed > size_ - size_ / 16) size_ = std::max(size_, with_margin(needed));
  most_ = std::max(most_, needed);
  if (++frames_ == span_) {
    size_ = std::min(size_, with_margin(std::max(most_, most_before_)));
    most_before_ = std::exchange(most_, 0);
    frames_ = 0;
  }
  if (limited_for_ > 0 && --limited_for_ == 0) limit_ = ceiling_;
  return lacked;
}

void Room::shrink_to(double part) {
  assert(part >= 0.0 && part <= 1.0);
  size_ = limit_ = static_cast<std::uint32_t>(part * size_);
  limited_for_ = patience;
}

FrameRoom::FrameRoom(std::uint32_t gaussians, std::uint64_t list_limit, bool splits)
    : visible_(std::min<std::uint64_t>(gaussians / 4 + 1, first_visible), std::max(gaussians, 1u),
               lists_span),
      lists_(std::min<std::uint64_t>(gaussians + 65536ull, first_entries),
             std::max<std::uint64_t>(list_limit, 1), lists_span),
      slices_(4096, splits ? std::numeric_limits<std::uint32_t>::max() : 0, slices_span) {}

FrameSizes FrameRoom::sizes() const { return {visible_.size(), lists_.size(), slices_.size()}; }

FrameSizes FrameRoom::limits() const { return {visible_.limit(), lists_.limit(), slices_.limit()}; }

bool FrameRoom::outgrown_by(const FrameSizes& needed) {
  slices_.outgrown_by(needed.slices);  // without them the frame was slower, not wrong
  const std::uint32_t had = visible_.size();
  const bool more_visible = visible_.outgrown_by(needed.visible);
  // Splats that found no room had no entries counted. If they are few, they are assumed to have as
  // many as the others. If they are many, the next drawing tells: the first Gaussians of a scene in
  // pages are coarse and may have far more entries than the rest.
  double counted = std::min(1.0, static_cast<double>(had) / std::max(needed.visible, 1u));
  if (counted < 0.5) counted = 1.0;
  const bool longer_lists = lists_.outgrown_by(static_cast<std::uint32_t>(
      std::min<double>(needed.list_entries / counted, std::numeric_limits<std::uint32_t>::max())));
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

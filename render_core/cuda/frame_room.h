#pragma once

#include <cstdint>

namespace catgs::cuda {

/// Room for one kind of elements whose number is known only after a frame: what frames needed in
/// the last one or two spans of key frames, plus a margin.
class Room {
 public:
  /// `span`: key frames, 1 or more.
  Room(std::uint64_t first_guess, std::uint64_t limit, int span);

  [[nodiscard]] std::uint32_t size() const { return size_; }
  [[nodiscard]] std::uint32_t limit() const { return limit_; }
  /// Call after a key frame. Returns whether it lacked room that it can get; size() then has that
  /// room.
  bool outgrown_by(std::uint32_t needed);
  /// Keeps a part of the present room, and for some hundred key frames no more than that.
  void shrink_to(double part);

 private:
  [[nodiscard]] std::uint32_t with_margin(std::uint32_t needed) const;

  std::uint32_t ceiling_, limit_, size_;
  int span_;
  int frames_ = 0;                            // of the current span
  std::uint32_t most_ = 0, most_before_ = 0;  // needed in this span and in the one before
  int limited_for_ = 0;                       // key frames
};

/// Numbers of elements that a frame needs, or has room for.
struct FrameSizes {
  std::uint32_t visible = 0;       // Gaussians in view
  std::uint32_t list_entries = 0;  // of all tile lists
  std::uint32_t slices = 0;        // of long tiles
};

/// The room that the frames of a View get. The host launches kernels before it knows their numbers
/// of elements. It allots what the last frames needed, and little more, because unused threads cost
/// time too. A frame that needed more is drawn again. Memory, once allocated, stays.
class FrameRoom {
 public:
  /// `list_limit`: the largest number of entries in all tile lists. `splits`: long tiles are cut
  /// into slices.
  FrameRoom(std::uint32_t gaussians, std::uint64_t list_limit, bool splits);

  [[nodiscard]] FrameSizes sizes() const;
  /// Upper bounds of sizes().
  [[nodiscard]] FrameSizes limits() const;
  /// Call after a key frame. Returns whether it lacked room and should be drawn again.
  bool outgrown_by(const FrameSizes& needed);
  /// Call when the device has not enough memory. Gives up slices first, which only make frames
  /// faster, then a part of the lists, whose ends are the farthest splats. False when little is
  /// left of them.
  bool retreat();

 private:
  Room visible_, lists_, slices_;
};

}  // namespace catgs::cuda

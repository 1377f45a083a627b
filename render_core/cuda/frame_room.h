#pragma once

#include <cstdint>

namespace catgs::cuda {

/// Room for one kind of things, whose need is known only after a frame: what frames needed in the
/// last one or two spans of key frames, and a margin.
class Room {
 public:
  /// `span`: key frames, 1 or more.
  Room(std::uint64_t first_guess, std::uint64_t limit, int span);

  [[nodiscard]] std::uint32_t size() const { return size_; }
  [[nodiscard]] std::uint32_t limit() const { return limit_; }
  /// After a key frame: whether it lacked room that there can be; then there is.
  bool outgrown_by(std::uint32_t needed);
  /// A part of what there is now, and for some hundred key frames no more than that.
  void shrink_to(double part);

 private:
  [[nodiscard]] std::uint32_t with_margin(std::uint32_t needed) const;

  std::uint32_t ceiling_, limit_, size_;
  int span_;
  int frames_ = 0;                            // of the running span
  std::uint32_t most_ = 0, most_before_ = 0;  // needed in it and in the one before
  int limited_for_ = 0;                       // key frames
};

/// Numbers of things that a frame needs, or has room for.
struct FrameSizes {
  std::uint32_t visible = 0;       // Gaussians in view
  std::uint32_t list_entries = 0;  // of all tile lists
  std::uint32_t slices = 0;        // of long tiles
};

/// How much room the frames of a View get. What fills it is launched before the host knows how much
/// there is: it allots by what the last frames needed (not much more, since threads for the rest
/// cost a little too), and draws a frame again that needed more. Memory, once allocated, stays.
class FrameRoom {
 public:
  /// `list_limit`: most entries of all tile lists. `splits`: long tiles are cut into slices.
  FrameRoom(std::uint32_t gaussians, std::uint64_t list_limit, bool splits);

  [[nodiscard]] FrameSizes sizes() const;
  /// What sizes() may become.
  [[nodiscard]] FrameSizes limits() const;
  /// After a key frame: whether it lacked room and should be drawn again.
  bool outgrown_by(const FrameSizes& needed);
  /// The device has no memory for this much: gives up slices, which only make frames faster, then a
  /// part of the lists, whose ends are the farthest splats. False when little is left of them.
  bool retreat();

 private:
  Room visible_, lists_, slices_;
};

}  // namespace catgs::cuda

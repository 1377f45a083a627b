#pragma once

namespace catgs {

/// Decides whether the groups of a View get windows: where a frame then takes less time than a
/// frame without windows does. A key frame with a window costs more than one without, and its
/// sub-frames cost less. Both shares are measured, and so is the number of frames that groups last.
/// Not thread-safe.
///
/// Every so often, a group is drawn the other way, so that the shares stay those of what the camera
/// sees now.
class WindowGain {
 public:
  /// Call at a key frame. `frames`: what the group before it lasted, or would have lasted if it had
  /// a window; its key frame included, and 0 for none. `refused`: it ended with a sub-frame that
  /// was begun for nothing. Whether the group that begins is to have a window.
  bool begin_group(int frames, bool refused);

  /// Times of a frame's stages, ms; each kind of frame tells its own.
  void note_plain(float ms) { add(plain_ms_, ms); }
  void note_key(float ms);
  void note_sub(float ms);

  /// Frames that a group lasts, its key frame included.
  [[nodiscard]] float expected_frames() const { return frames_; }
  /// The time of a frame of a group with a window, as a share of that of a frame without.
  [[nodiscard]] float expected_share() const;

 private:
  static void add(float& mean, float value);

  float frames_ = 1.0f;
  float plain_ms_ = 0.0f, key_ms_ = 0.0f;  // means of late; 0: unknown
  // First guesses, from rooms and cities on one H200.
  float key_share_ = 1.25f, sub_share_ = 0.73f;
  bool windows_ = false;
  int since_other_ = 0;  // groups since one was drawn the other way
};

}  // namespace catgs

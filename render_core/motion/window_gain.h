#pragma once

namespace catgs {

/// Decides whether the groups of a View get windows: where a frame then takes less time than a
/// frame without windows does. A key frame with a window costs more than one without, and its
/// sub-frames cost less. Both shares are measured, and so is the number of frames that groups last.
/// Not thread-safe.
class WindowGain {
 public:
  /// The group that has ended.
  struct Group {
    int frames = 0;        // its key frame included; 0: there was none
    bool window = false;   // it had one. Else it would have lasted so long, as far as poses tell
    bool refused = false;  // it ended with a sub-frame that was begun for nothing
  };

  /// Call at a key frame. Whether the group that begins is to have a window.
  bool begin_group(const Group& last);

  /// Times of a frame's stages, ms; each kind of frame tells its own.
  void note_plain(float ms) { plain_ms_ = ms; }
  void note_key(float ms);
  void note_sub(float ms);

 private:
  static void add(float& mean, float value);
  /// One measurement moves a share by little: the view may change between two frames.
  static void measure(float& share, float now);
  [[nodiscard]] bool pays(float frames) const;

  float planned_frames_ = 0.0f, window_frames_ = 0.0f;  // of a group, means; 0: unknown
  float plain_ms_ = 0.0f, key_ms_ = 0.0f;               // of the last of its kind; 0: used up
  // Shares of the time of a frame without windows. First guesses: rooms and cities on one H200.
  float key_share_ = 1.25f, sub_share_ = 0.73f;
  bool windows_ = false;
  int wait_frames_ = 0;  // before windows are tried again
  int groups_ = 0;       // with windows, since one was drawn without
};

}  // namespace catgs

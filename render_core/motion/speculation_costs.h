#pragma once

#include "render_core/motion/frame_groups.h"

namespace catgs {

/// Decides from the measured cost of frames whether speculation pays. A key frame with a window
/// costs more than one without. Where a camera breaks its windows early (large motion, a low frame
/// rate), the few sub-frames after it do not make up for that. Frames then get no window for a
/// while, and for longer each time that it happens. Needs no clock; not thread-safe.
class SpeculationCosts {
 public:
  /// Call after each frame of a View, with its kind and its cost in any unit.
  void note(FrameKind kind, int window, double cost);
  /// Whether the next frame may begin a group, or continue one.
  [[nodiscard]] bool pays() const { return resting_ == 0; }
  /// Ends the group: the next frame will be a key frame.
  void forget() { group_ = {}; }

 private:
  /// A running mean over about the last eight samples.
  struct Mean {
    double value = 0.0;
    int samples = 0;

    void add(double sample);
  };
  struct Group {
    double cost = 0.0;
    int frames = 0;
    int window = 0;
  };

  void close_group();

  Mean exact_;    // of frames without a window
  Mean grouped_;  // of frames in groups, key frames and sub-frames alike
  Group group_;
  int resting_ = 0;        // frames
  int rest_ = least_rest;  // length of the next rest
  int since_exact_ = 0;    // frames

  static constexpr int least_rest = 32, most_rest = 256;  // frames
};

}  // namespace catgs

#pragma once

#include "render_core/motion/frame_groups.h"

namespace catgs {

/// Whether speculation pays, by what frames were measured to cost. A key frame with a window costs
/// more than one without, and where a camera breaks its windows early (large motion, a low frame
/// rate) the few sub-frames behind it do not bring that back. Then frames get no window for a
/// while, longer each time that this holds. Needs no clock; not thread-safe.
class SpeculationCosts {
 public:
  /// After each frame of a View: what it was, and what it cost, in any unit.
  void note(FrameKind kind, int window, double cost);
  /// Whether the next frame may begin a group, or go on with one.
  [[nodiscard]] bool pays() const { return resting_ == 0; }
  /// The next frame may be no sub-frame of the group so far.
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

  Mean exact_;    // of a frame without a window
  Mean grouped_;  // of a frame of a group, key frame and sub-frames alike
  Group group_;
  int resting_ = 0;        // frames
  int rest_ = least_rest;  // of the next time that it does not pay
  int since_exact_ = 0;    // frames

  static constexpr int least_rest = 32, most_rest = 256;  // frames
};

}  // namespace catgs

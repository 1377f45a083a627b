#pragma once

#include <span>

#include "server/session/session_usage.h"

namespace catgs {

/// What a session asks of the machine.
struct SessionDemand {
  std::optional<SessionUsage::FrameCost> frame_cost;  // as measured
  double megapixels = 0;                              // of a frame
  int fps = 60;                                       // nominal
  bool fresh = false;  // admitted lately and not at rest: its cost is about to be known
};

/// Whether there is room for one more session. Unknown: not before it is known what some cost.
enum class Room { yes, no, unknown };

/// Whether one more session leaves everybody a decent rate, judged by what the frames of the
/// present ones were measured to cost. Processors and GPUs are counted apart. Pure.
class AdmissionBudget {
 public:
  struct Capacity {
    double cpus = 1;  // that work at the same time
    double gpus = 0;
  };
  /// `min_fps`: the rate that everybody shall keep, or the own nominal one where that is lower; 0:
  /// there is always room.
  AdmissionBudget(Capacity capacity, int min_fps) : capacity_(capacity), min_fps_(min_fps) {}

  /// A session without a measured cost is taken to cost the mean of the others by its pixels. With
  /// nothing measured there is room for a fresh one on each GPU, or on each processor where none
  /// renders: others wait for what these are found to cost. For the first one there always is.
  [[nodiscard]] Room room(std::span<const SessionDemand> present,
                          const SessionDemand& newcomer) const;

  /// Of processors and GPUs, what the sessions take at the rate that everybody shall keep; 1: all.
  struct Load {
    double cpus = 0;
    double gpus = 0;
  };
  /// Zero while nothing is measured.
  [[nodiscard]] Load load(std::span<const SessionDemand> sessions) const;

  /// How many sessions like the present ones there is room for, at most `max_sessions`.
  [[nodiscard]] int seats(std::span<const SessionDemand> present, int max_sessions) const;

 private:
  const Capacity capacity_;
  const int min_fps_;
};

}  // namespace catgs

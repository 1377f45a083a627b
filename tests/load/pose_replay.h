#pragma once

#include <cstdint>
#include <memory>

#include "render_core/motion/trajectory.h"

namespace catgs::load {

/// The samples of a trajectory at their own times, for ever: forth and back, so that its seam is
/// no jump. A trajectory of one pose repeats it 60 times a second.
class PoseReplay {
 public:
  /// Begins `offset_us` into the trajectory, so that sessions with one trace differ.
  PoseReplay(std::shared_ptr<const Trajectory> trajectory, std::int64_t offset_us);

  /// When the next sample is due, since the beginning.
  [[nodiscard]] std::int64_t next_time_us() const;
  /// Returns it and moves on.
  const Pose& take();

  /// Length of the way forth.
  [[nodiscard]] std::int64_t span_us() const;

 private:
  /// Time of the sample since the trajectory's own start.
  [[nodiscard]] std::int64_t time_us(std::int64_t number) const;
  [[nodiscard]] std::size_t index(std::int64_t number) const;

  std::shared_ptr<const Trajectory> trajectory_;
  std::int64_t offset_us_;
  std::int64_t number_ = 0;  // of the next sample, counted through all turns
};

}  // namespace catgs::load

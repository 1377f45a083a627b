#pragma once

#include <optional>
#include <span>
#include <vector>

#include "server/session/session_usage.h"

namespace catgs {

/// What a session asks of the machine.
struct SessionDemand {
  std::optional<SessionUsage::FrameCost> frame_cost;  // as measured
  double megapixels = 0;                              // of a frame
  int fps = 60;                                       // nominal
  bool fresh = false;        // admitted lately and not at rest: its cost is about to be known
  double pixel_share = 1.0;  // of the pixels that its client wishes; it has no more at the moment
};

/// Whether there is room for one more session. Unknown: not before it is known what some cost.
enum class Room { yes, no, unknown };

/// Work of a frame in the unit of a megapixel's work. A part of it does not depend on the size:
/// the CPU core draws the demo city in 11 ms and another 17 ms for each megapixel.
[[nodiscard]] double frame_work(double megapixels);

/// Decides who gets in, and how large everybody's pictures may be, so that all keep a decent rate.
/// It judges by what the frames of the present sessions were measured to cost. It counts processors
/// and GPUs apart. Pure.
///
/// A wish for large pictures keeps nobody out. A newcomer gets as many of its pixels as there is
/// room for, down to 320x180. Where even that is too much, those present who take more than an
/// equal share give pixels up. They get them back when there is room and nobody waits.
class AdmissionBudget {
 public:
  struct Capacity {
    double cpus = 1;  // that work at the same time
    double gpus = 0;
  };
  /// `min_fps`: the rate that everybody shall keep, or the own nominal one where that is lower; 0:
  /// there is always room.
  AdmissionBudget(Capacity capacity, int min_fps) : capacity_(capacity), min_fps_(min_fps) {}

  struct Offer {
    Room room = Room::yes;
    double pixel_share = 1.0;  // of what the newcomer wishes
    /// What each present session keeps of the pixels that it has; empty: all keep all.
    std::vector<double> kept{};
  };
  /// A session without a measured cost is taken to cost the mean of the others by its pixels. With
  /// nothing measured there is room for a fresh one on each GPU, or on each processor where none
  /// renders: others wait for what these are found to cost. For the first one there always is.
  [[nodiscard]] Offer offer(std::span<const SessionDemand> present,
                            const SessionDemand& newcomer) const;

  struct Growth {
    std::size_t session = 0;
    double pixel_share = 1.0;
  };
  /// Of the present sessions that lack pixels, the one with the smallest pictures, if there is room
  /// for more of them.
  [[nodiscard]] std::optional<Growth> growth(std::span<const SessionDemand> present) const;

  /// Of processors and GPUs, what the sessions take at the rate that everybody shall keep; 1: all.
  struct Load {
    double cpus = 0;
    double gpus = 0;
    [[nodiscard]] double fullest() const { return cpus > gpus ? cpus : gpus; }
  };
  /// Zero while nothing is measured.
  [[nodiscard]] Load load(std::span<const SessionDemand> sessions) const;

  /// How many sessions like the present ones there is room for, at most `max_sessions`.
  [[nodiscard]] int seats(std::span<const SessionDemand> present, int max_sessions) const;

 private:
  /// Takes pixels from those in `sessions` who have more than an equal share, largest first, until
  /// all fit. False: they do not.
  [[nodiscard]] bool make_room(std::vector<SessionDemand>& sessions) const;
  [[nodiscard]] double total(std::span<const SessionDemand> sessions) const {
    return load(sessions).fullest();
  }

  const Capacity capacity_;
  const int min_fps_;
};

}  // namespace catgs

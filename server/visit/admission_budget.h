#pragma once

#include <optional>
#include <span>
#include <vector>

#include "server/visit/session_usage.h"

namespace catgs {

/// The load that a session puts on the machine.
struct SessionDemand {
  std::optional<SessionUsage::FrameCost> frame_cost;  // measured; none: not yet
  double megapixels = 0;                              // of a frame
  int fps = 60;                                       // nominal
  bool fresh = false;        // admitted lately and moving: its cost is about to be measured
  double pixel_share = 1.0;  // currently granted share of the pixels that its client asks for
};

/// Whether one more session fits. `unknown`: the cost of recent sessions is not measured yet.
enum class Room { yes, no, unknown };

/// The work of a frame, in units of one megapixel's work. A part of the work does not depend on the
/// size: the CPU core draws the demo city in 11 ms plus 17 ms a megapixel.
[[nodiscard]] double frame_work(double megapixels);

/// Decides which clients are admitted and how large the pictures of all sessions may be, so that
/// every session keeps a usable frame rate. Decisions use the measured frame costs of the present
/// sessions. Processors and GPUs are counted separately. Pure.
///
/// A request for large pictures keeps no other client out. A newcomer gets as many of its pixels as
/// fit, down to 320x180. When even 320x180 does not fit, sessions with more than an equal share
/// give pixels up. They get them back when there is room and no client waits.
class AdmissionBudget {
 public:
  struct Capacity {
    double cpus = 1;  // usable in parallel
    double gpus = 0;
  };
  /// `min_fps` is the rate that every session keeps, or its own nominal rate if that is lower. With
  /// 0 there is always room.
  AdmissionBudget(Capacity capacity, int min_fps) : capacity_(capacity), min_fps_(min_fps) {}

  /// Above 0.
  void set_cpus(double cpus) { capacity_.cpus = cpus; }

  struct Offer {
    Room room = Room::yes;
    double pixel_share = 1.0;  // of what the newcomer asks for
    /// The share of its pixels that each present session keeps; empty: all keep all.
    std::vector<double> kept{};
  };
  /// A session without a measured cost is assumed to cost the mean of the others, scaled by its
  /// pixels. When no cost is known, one fresh session fits on each GPU, or on each processor where
  /// no GPU renders. Further sessions wait until that cost is measured. The first session always
  /// fits.
  [[nodiscard]] Offer offer(std::span<const SessionDemand> present,
                            const SessionDemand& newcomer) const;

  struct Growth {
    std::size_t session = 0;
    double pixel_share = 1.0;
  };
  /// Among the sessions that lack pixels, chooses the one with the smallest pictures. Returns
  /// nothing if there is no room for larger ones.
  [[nodiscard]] std::optional<Growth> growth(std::span<const SessionDemand> present) const;

  /// The share of processors and GPUs that the sessions take at the guaranteed rate; 1: all of it.
  struct Load {
    double cpus = 0;
    double gpus = 0;
    [[nodiscard]] double fullest() const { return cpus > gpus ? cpus : gpus; }
  };
  /// Zero while nothing is measured.
  [[nodiscard]] Load load(std::span<const SessionDemand> sessions) const;

  /// How many sessions like the present ones fit, at most `max_sessions`.
  [[nodiscard]] int seats(std::span<const SessionDemand> present, int max_sessions) const;

 private:
  /// Takes pixels from `sessions` with more than an equal share, largest first, until all fit.
  /// False: they do not fit.
  [[nodiscard]] bool make_room(std::vector<SessionDemand>& sessions) const;
  [[nodiscard]] double total(std::span<const SessionDemand> sessions) const {
    return load(sessions).fullest();
  }

  Capacity capacity_;
  const int min_fps_;
};

}  // namespace catgs

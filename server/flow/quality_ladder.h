#pragma once

#include <chrono>
#include <cstddef>
#include <optional>
#include <vector>

#include <glm/vec2.hpp>

#include "server/base/clock.h"

namespace catgs {

/// One step of the ladder, as a fraction of the client's request.
struct Rung {
  double scale = 1.0;      // of width and of height
  double fps_share = 1.0;  // of the frame rate

  bool operator==(const Rung&) const = default;
};

/// Chooses picture size and frame rate by what network and decoder sustain. The bitrate gives way
/// first. Below 0.025 bit a pixel the size falls to 3/4, then 1/2 a side; after that the frame rate
/// to 1/2, then 1/4.
/// - Down: after one second of shortage.
/// - Up: after three seconds in which the better rung would have had 0.04 bit a pixel, or the
///   encoder left half of its bits unused.
/// - Up at once for two seconds after a rest, in which the supply may have changed unseen.
/// - When the better rung does not hold for ten seconds, the next attempt waits twice as long, at
///   most a minute.
/// Pure; not thread-safe.
class QualityLadder {
 public:
  /// The rates available at the moment.
  struct Supply {
    double bits_per_s = 0.0;    // of the network
    double pixels_per_s = 0.0;  // of the decoder
    bool bits_unused = false;   // the encoder leaves half of the bits unused
  };

  QualityLadder() : QualityLadder({16, 16}, 1) {}
  /// The client's request is the top of the ladder.
  QualityLadder(glm::ivec2 size_px, int fps);

  /// Frames begin again, after a rest.
  void rested(TimePoint now) { rested_at_ = now; }
  /// True: the rung has changed.
  bool update(const Supply& supply, TimePoint now);
  [[nodiscard]] const Rung& rung() const { return rungs_[current_]; }
  [[nodiscard]] std::size_t steps_down() const { return current_; }

 private:
  [[nodiscard]] double pixels_per_s(std::size_t rung) const;
  [[nodiscard]] bool starves(const Supply& supply) const;
  [[nodiscard]] bool could_rise(const Supply& supply) const;
  void step_to(std::size_t rung, TimePoint now);

  double top_pixels_per_s_;
  std::vector<Rung> rungs_;
  std::size_t current_ = 0;
  std::optional<TimePoint> starving_since_;
  std::optional<TimePoint> rich_since_;
  std::optional<TimePoint> risen_at_;
  std::optional<TimePoint> rested_at_;
  std::chrono::milliseconds patience_;  // before it rises
};

}  // namespace catgs

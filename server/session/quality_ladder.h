#pragma once

#include <chrono>
#include <cstddef>
#include <vector>

#include <glm/vec2.hpp>

#include "server/pipeline/frame_ticket.h"

namespace catgs {

/// One step of the ladder: what the client asked for, or less.
struct Rung {
  double scale = 1.0;      // of width and of height
  double fps_share = 1.0;  // of the frame rate

  bool operator==(const Rung&) const = default;
};

/// Chooses picture size and frame rate for what the network and the client's decoder take. The
/// bitrate gives way first: size falls (3/4, then 1/2 a side) when less than 0.025 bit a pixel is
/// left, the frame rate (1/2, then 1/4) after it. Down after a second of want. Up after three
/// seconds in which the better rung would have had 0.04 bit a pixel, or in which the encoder found
/// no use for half of its bits; when the better rung does not hold for ten seconds the next try
/// waits twice as long, a minute at most. Pure; not thread-safe.
class QualityLadder {
 public:
  /// What can be had at the moment.
  struct Supply {
    double bits_per_s = 0.0;    // of the network
    double pixels_per_s = 0.0;  // of the decoder
    bool bits_unused = false;   // the encoder leaves half of them
  };

  QualityLadder() : QualityLadder({16, 16}, 1) {}
  /// The client's wish: the top of the ladder.
  QualityLadder(glm::ivec2 size_px, int fps);

  /// True: another rung holds from here on.
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
  TimePoint starving_since_{};  // epoch: it is not
  TimePoint rich_since_{};
  TimePoint risen_at_{};
  std::chrono::milliseconds patience_;  // before it rises
};

}  // namespace catgs

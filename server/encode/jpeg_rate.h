#pragma once

#include <cstddef>

namespace catgs {

/// Chooses the quantiser of each JPEG so that frames stay near bitrate / fps. Every JPEG stands
/// alone, so the last one is the best forecast of the next: its bytes times qscale^0.7 hardly move
/// between neighbouring frames (the exponent was fitted on rendered scenes).
class JpegRateControl {
 public:
  static constexpr int finest_qscale = 2;
  static constexpr int sharp_qscale = 4;  // finer ones can hardly be told apart
  static constexpr int coarsest_qscale = 31;

  /// `pixels` of a frame; set the budget before the first qscale().
  explicit JpegRateControl(std::size_t pixels);

  void set_budget(int bitrate_kbps, int fps);
  /// libavcodec's quantiser scale for the next frame.
  [[nodiscard]] int qscale() const;
  /// Told after every frame: how large it became.
  void update(int qscale, std::size_t bytes);

 private:
  double budget_bytes_ = 0;
  double complexity_;  // forecast of bytes x qscale^0.7
};

}  // namespace catgs

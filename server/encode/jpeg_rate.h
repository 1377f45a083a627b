#pragma once

#include <cstddef>

namespace catgs {

/// Chooses the quantiser of each JPEG so that frames stay near bitrate / fps. The last JPEG
/// predicts the next: bytes times qscale^0.7 is nearly constant between neighbouring frames. The
/// exponent was fitted on rendered scenes.
class JpegRateControl {
 public:
  static constexpr int finest_qscale = 2;
  static constexpr int sharp_qscale = 4;  // finer ones can hardly be told apart
  static constexpr int coarsest_qscale = 31;

  /// `pixels` is the size of a frame. Call set_budget() before the first qscale().
  explicit JpegRateControl(std::size_t pixels);

  void set_budget(int bitrate_kbps, int fps);
  /// libavcodec's quantiser scale for the next frame.
  [[nodiscard]] int qscale() const;
  /// Records the size of each frame.
  void update(int qscale, std::size_t bytes);

 private:
  double budget_bytes_ = 0;
  double complexity_;  // forecast of bytes x qscale^0.7
};

}  // namespace catgs

#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <vector>

#include <glm/gtc/quaternion.hpp>
#include <glm/vec2.hpp>

#include "tests/load/warp.h"

namespace catgs::load {

/// Values of the last `span_us` before a time.
class TimeWindow {
 public:
  explicit TimeWindow(std::int64_t span_us) : span_us_(span_us) {}

  void push(std::int64_t time_us, double value);
  /// In increasing order.
  [[nodiscard]] std::vector<double> sorted(std::int64_t now_us) const;

 private:
  std::int64_t span_us_;
  std::deque<std::pair<std::int64_t, double>> values_;
};

/// The factors nearest to these for which a picture of the view has even sides, as Display of the
/// page chooses them: a camera at rest then sees its pixels.
glm::dvec2 even_overscan(const glm::dvec2& factors, glm::ivec2 view_px);

/// How much larger than the view the page wants its pictures: warp_policy.ts and turn_forecast.ts
/// with "Smooth turning: automatic" on a display that is fast enough.
/// tests/support/warp_golden.json holds both to the same choices.
class Overscan {
 public:
  /// Sides of pictures over those of the view.
  [[nodiscard]] glm::dvec2 sides() const { return sides_; }
  /// The visitor's camera has moved here.
  void moved(std::int64_t now_us, const Pose& camera);
  /// The view of a moving camera was drawn from a picture. Returns whether sides() have changed.
  bool drawn(const Eye& picture, double picture_aspect, const Eye& view, double view_aspect,
             double distance, std::int64_t now_us);

 private:
  struct Sample {
    std::int64_t time_us = 0;
    glm::dquat orientation{};
  };
  /// Where the camera will look when the picture of its present pose is about to be replaced.
  [[nodiscard]] std::optional<glm::dquat> later(std::int64_t now_us) const;
  bool choose(const glm::dvec2& needed, std::int64_t now_us);

  TimeWindow widths_{1'000'000}, heights_{1'000'000};
  TimeWindow lags_s_{10'000'000};
  std::deque<Sample> samples_;
  glm::dvec2 sides_{1.0};
  std::optional<std::int64_t> needed_us_;  // when the present sides were last needed
};

}  // namespace catgs::load

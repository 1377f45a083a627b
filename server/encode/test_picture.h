#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <glm/vec2.hpp>

#include "render_core/frame/renderer.h"

namespace catgs {

// Pictures that test encoders, for the self-test and for tests.

/// An i420 picture that owns its memory, without padding. It starts black and has even sides.
struct I420Picture {
  explicit I420Picture(glm::ivec2 size);
  [[nodiscard]] FrameView view();  // borrowed from this picture

  glm::ivec2 size_px;
  std::array<std::vector<std::uint8_t>, 3> planes;  // Y, Cb, Cr
};

/// Smooth structure and fine texture that pan by (3, 1) px per unit of `time`, like a turning
/// camera's view.
I420Picture moving_picture(glm::ivec2 size_px, int time);

/// Peak signal-to-noise ratio in dB of 8-bit samples, vectors of equal length; infinite for equal
/// ones.
double psnr(const std::vector<std::uint8_t>& a, const std::vector<std::uint8_t>& b);

}  // namespace catgs

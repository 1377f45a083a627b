#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "render_core/renderer.h"
#include "server/encode/decoder.h"

namespace catgs::test {

/// An i420 picture in memory of its own; black at first. Even sides.
struct Picture {
  explicit Picture(glm::ivec2 size);
  [[nodiscard]] FrameView view();

  glm::ivec2 size_px;
  std::array<std::vector<std::uint8_t>, 3> planes;
};

/// Smooth structure and fine texture that pan by (3, 1) px a frame: like a rendered view that
/// turns.
Picture moving_picture(glm::ivec2 size_px, int time);

/// Peak signal-to-noise ratio in dB of two planes of equal length; infinite for equal ones.
double psnr(const std::vector<std::uint8_t>& a, const std::vector<std::uint8_t>& b);

// The definitions of ITU-R BT.709-6 and BT.601-7, written out on their own so that they judge the
// product's.

/// Unrounded BT.709 limited-range codes (Y, Cb, Cr) of a colour in [0, 255].
glm::dvec3 video_codes(glm::dvec3 rgb);

/// Colour in 0…255 at a pixel of a decoded picture: BT.709 limited, or BT.601 full range.
glm::dvec3 rgb_at(const DecodedPicture& picture, glm::ivec2 pixel);

}  // namespace catgs::test

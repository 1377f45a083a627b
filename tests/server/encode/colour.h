#pragma once

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "server/encode/decoder.h"

namespace catgs::test {

// The definitions of ITU-R BT.709-6 and BT.601-7, written out on their own so that they judge the
// product's.

/// Unrounded BT.709 limited-range codes (Y, Cb, Cr) of a colour in [0, 255].
glm::dvec3 video_codes(glm::dvec3 rgb);

/// Colour in 0…255 at a pixel of a decoded picture: BT.709 limited, or BT.601 full range.
glm::dvec3 rgb_at(const DecodedPicture& picture, glm::ivec2 pixel);

}  // namespace catgs::test

#pragma once

#include <cstddef>
#include <cstdint>

#include <glm/vec2.hpp>

namespace catgs {

/// Three 8-bit planes of a 4:2:0 picture; chroma planes have half its sides.
struct Yuv420Planes {
  std::uint8_t* data[3] = {};
  std::ptrdiff_t stride_bytes[3] = {};
};

/// Converts video samples (BT.709, limited range) to those of JFIF (BT.601, full range). Sides are
/// even. Chroma stays centred in each 2x2 pixels. The planes must not overlap.
void video_to_jfif(const Yuv420Planes& video, const Yuv420Planes& jfif, glm::ivec2 size_px);

}  // namespace catgs

#pragma once

#include <optional>

#include <glm/vec2.hpp>

namespace catgs::h264 {

/// Returns the lowest level (as level_idc: 31 = level 3.1) for this frame size (luma samples), rate
/// (frames/s) and bitrate (1000 bit/s) with one reference frame. Limits are those of ITU-T H.264
/// table A-1. nullopt: no level fits.
std::optional<int> level(glm::ivec2 size_px, int fps, int bitrate_kbps);

/// Returns the MaxBR of a level in 1000 bit/s for the Baseline and Main profiles. High allows a
/// quarter more. nullopt: the level_idc is not in table A-1.
std::optional<int> level_max_bitrate_kbps(int level_idc);

}  // namespace catgs::h264

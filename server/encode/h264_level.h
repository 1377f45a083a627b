#pragma once

#include <optional>

#include <glm/vec2.hpp>

namespace catgs::h264 {

/// Lowest level (as level_idc: 31 = level 3.1) whose limits in ITU-T H.264 table A-1 admit frames
/// of this size (luma samples) at this rate (frames/s) and bitrate (1000 bit/s), with one reference
/// frame. nullopt: no level does.
std::optional<int> level(glm::ivec2 size_px, int fps, int bitrate_kbps);

/// MaxBR of a level, in 1000 bit/s, as it stands for the Baseline and Main profiles (High allows a
/// quarter more); nullopt for a level_idc that is not in table A-1.
std::optional<int> level_max_bitrate_kbps(int level_idc);

}  // namespace catgs::h264

#include "server/encode/h264_level.h"

#include <algorithm>
#include <array>
#include <cstdint>

namespace catgs::h264 {

namespace {

struct Limits {
  int level_idc;
  std::int64_t macroblocks_per_s;      // MaxMBPS
  std::int64_t macroblocks_per_frame;  // MaxFS
  int bitrate_kbps;                    // MaxBR
};

// ITU-T H.264 table A-1. Level 1b is left out: its coding differs between profiles, and no stream
// here is that small.
constexpr std::array<Limits, 19> table_a1 = {{
    {10, 1485, 99, 64},
    {11, 3000, 396, 192},
    {12, 6000, 396, 384},
    {13, 11880, 396, 768},
    {20, 11880, 396, 2000},
    {21, 19800, 792, 4000},
    {22, 20250, 1620, 4000},
    {30, 40500, 1620, 10000},
    {31, 108000, 3600, 14000},
    {32, 216000, 5120, 20000},
    {40, 245760, 8192, 20000},
    {41, 245760, 8192, 50000},
    {42, 522240, 8704, 50000},
    {50, 589824, 22080, 135000},
    {51, 983040, 36864, 240000},
    {52, 2073600, 36864, 240000},
    {60, 4177920, 139264, 240000},
    {61, 8355840, 139264, 480000},
    {62, 16711680, 139264, 800000},
}};

}  // namespace

std::optional<int> level(glm::ivec2 size_px, int fps, int bitrate_kbps) {
  const std::int64_t width = (size_px.x + 15) / 16;
  const std::int64_t height = (size_px.y + 15) / 16;
  const auto admits = [&](const Limits& limits) {
    // A.3.1: neither side may exceed Sqrt(MaxFS * 8) macroblocks.
    const std::int64_t side_squared = limits.macroblocks_per_frame * 8;
    return width * height <= limits.macroblocks_per_frame && width * width <= side_squared &&
           height * height <= side_squared && width * height * fps <= limits.macroblocks_per_s &&
           bitrate_kbps <= limits.bitrate_kbps;
  };
  const auto* found = std::find_if(table_a1.begin(), table_a1.end(), admits);
  if (found == table_a1.end()) return std::nullopt;
  return found->level_idc;
}

std::optional<int> level_max_bitrate_kbps(int level_idc) {
  const auto* found = std::find_if(table_a1.begin(), table_a1.end(), [&](const Limits& limits) {
    return limits.level_idc == level_idc;
  });
  if (found == table_a1.end()) return std::nullopt;
  return found->bitrate_kbps;
}

}  // namespace catgs::h264

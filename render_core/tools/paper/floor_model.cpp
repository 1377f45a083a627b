#include "render_core/tools/paper/floor_model.h"

#include <algorithm>
#include <cmath>

namespace catgs {
namespace {

// Bytes of one element.
constexpr double shape = 32.0;      // a resident Gaussian without harmonics above degree 0
constexpr double record = 32.0;     // a projected Gaussian, as the blend reads it
constexpr double depth_key = 4.0;   // 24 bits of it are sorted
constexpr double slot = 4.0;        // of which 24 bits are sorted
constexpr double tile = 2.0;        // index of a tile, as a sort key
constexpr double tile_count = 4.0;  // of one Gaussian
constexpr double colour = 6.0;      // cached, half precision
constexpr double rgb_pixel = 12.0;
constexpr double cluster_bounds = 24.0;

constexpr double gaussians_per_cluster = 256.0;
constexpr double bits_per_pass = 8.0;
constexpr double depth_passes = 24.0 / bits_per_pass;

/// Bytes of a resident Gaussian with its harmonics.
double whole(const FrameWork& f) { return f.scene_bytes / std::max(f.gaussians, 1.0); }

double tile_passes(const FrameWork& f) {
  return std::ceil(std::ceil(std::log2(std::max(f.tiles, 2.0))) / bits_per_pass);
}

StageWork key_stage(Stage stage, const FrameWork& f) {
  switch (stage) {
    case Stage::project:
      return {f.gaussians / gaussians_per_cluster * cluster_bounds +
                  f.visible * (whole(f) + record + depth_key + tile_count),
              0.0};
    case Stage::bin:
      return {f.visible * (slot + record) + f.list_entries * (tile + slot), 0.0};
    case Stage::sort:
      return {2.0 * (f.visible * (depth_key + slot) * depth_passes +
                     f.list_entries * (tile + slot) * tile_passes(f)),
              0.0};
    case Stage::blend:
    case Stage::convert:
      break;
  }
  return {};
}

StageWork sub_stage(Stage stage, const FrameWork& f) {
  if (stage == Stage::project) return {f.visible * (shape + colour + record + depth_key), 0.0};
  if (stage == Stage::sort) return {f.reached_entries * (2.0 * slot + depth_key), 0.0};
  return {};
}

}  // namespace

StageWork stage_work(Stage stage, FrameKind kind, const FrameWork& frame) {
  if (stage == Stage::blend) {
    return {frame.reached_entries * (slot + record) + frame.pixels * rgb_pixel,
            frame.warp_evaluations};
  }
  return kind == FrameKind::key ? key_stage(stage, frame) : sub_stage(stage, frame);
}

double bytes_ms(const StageWork& work, const DeviceRates& rates) {
  return 1e3 * work.bytes / rates.dram_bytes_per_s;
}

double evaluations_ms(const StageWork& work, const DeviceRates& rates) {
  return 1e3 * work.evaluations * rates.instructions_per_evaluation / rates.warp_instructions_per_s;
}

double floor_ms(const StageWork& work, const DeviceRates& rates) {
  return std::max(bytes_ms(work, rates), evaluations_ms(work, rates));
}

}  // namespace catgs

#pragma once

#include "render_core/renderer.h"

namespace catgs {

// A model of the least cost of a frame in the CUDA core. Each stage costs the bytes that it must
// move, at the memory's rate; the blend also costs its evaluations, at the rate of instructions.
// The model is no hard bound, because data that stays in a cache between stages costs less.

/// Rates of a device. The defaults are an H200's: nine tenths of its memory's 4.8 TB/s, and 132
/// processors that issue four warp instructions per clock at 1.8 GHz.
struct DeviceRates {
  double dram_bytes_per_s = 4.3e12;
  double warp_instructions_per_s = 0.95e12;
  double instructions_per_evaluation = 16.0;  // one list entry on a warp's 8x4 pixels
};

/// Sizes of a frame, or means over several frames.
struct FrameWork {
  double gaussians = 0.0;
  double scene_bytes = 0.0;  // of all Gaussians, resident
  double visible = 0.0;
  double list_entries = 0.0;      // sub-frames: those of their key frame
  double reached_entries = 0.0;   // see WorkCount
  double warp_evaluations = 0.0;  // see WorkCount
  double tiles = 0.0;
  double pixels = 0.0;
};

/// The work of one stage.
struct StageWork {
  double bytes = 0.0;
  double evaluations = 0.0;
};

/// The bytes that a stage moves. There are V visible Gaussians and E list entries; R entries are
/// reached.
///
/// Key frames, and frames of the exact pipeline:
/// - project: bounds of the clusters + V (Gaussian + record + depth key + tile count)
/// - bin: V (order + record) + E (tile + slot)
/// - sort: a read and a write per pass. 3 passes over V (key + slot); over E (tile + slot) a pass
///   for each 8 bits of the number of tiles
/// - blend: R (slot + record) + the picture in floats
/// Sub-frames, which bin nothing:
/// - project: V (shape + cached colour + record + depth key)
/// - sort: R (slot, read and written, + depth key)
/// - blend: as in key frames
/// A sub-frame without a colour cache reads whole Gaussians, so it cannot reach this floor.
StageWork stage_work(Stage stage, FrameKind kind, const FrameWork& frame);

/// Milliseconds of the work at these rates. Memory and processors work at the same time.
double bytes_ms(const StageWork& work, const DeviceRates& rates);
double evaluations_ms(const StageWork& work, const DeviceRates& rates);
double floor_ms(const StageWork& work, const DeviceRates& rates);

}  // namespace catgs

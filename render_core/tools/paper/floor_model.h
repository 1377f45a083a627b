#pragma once

#include "render_core/renderer.h"

namespace catgs {

// What a frame of the CUDA core costs at least, to reason with: the bytes that each stage cannot
// avoid moving, at the memory's rate, and the blend's evaluations at the rate of instructions. No
// hard bound: what stays in a cache between stages costs less.

/// Of a device. The defaults are an H200's: nine tenths of its memory's 4.8 TB/s, and 132
/// processors that issue four warp instructions a clock at 1.8 GHz.
struct DeviceRates {
  double dram_bytes_per_s = 4.3e12;
  double warp_instructions_per_s = 0.95e12;
  double instructions_per_evaluation = 16.0;  // one list entry on a warp's 8x4 pixels
};

/// Sizes of a frame; means over several will do.
struct FrameWork {
  double gaussians = 0.0;
  double scene_bytes = 0.0;  // resident, of all of them
  double visible = 0.0;
  double list_entries = 0.0;      // of a sub-frame: those of its key frame
  double reached_entries = 0.0;   // as WorkCount has it
  double warp_evaluations = 0.0;  // likewise
  double tiles = 0.0;
  double pixels = 0.0;
};

/// What a stage has to do.
struct StageWork {
  double bytes = 0.0;
  double evaluations = 0.0;
};

/// The bytes that a stage moves, with V visible Gaussians, E list entries, and R of them reached.
/// A key frame, or a frame of the exact pipeline:
///   project  bounds of the clusters; V (Gaussian + record + depth key + tile count)
///   bin      V (order + record) + E (tile + slot)
///   sort     a read and a write per pass: 3 passes of V (key + slot), and of E (tile + slot) a
///            pass for each 8 bits of the tiles' number
///   blend    R (slot + record) + the picture in floats
/// A sub-frame, which bins nothing:
///   project  V (shape + cached colour + record + depth key)
///   sort     R (slot, read and written, + depth key)
///   blend    as in a key frame
/// A sub-frame without a colour cache reads whole Gaussians, so it cannot reach this floor.
StageWork stage_work(Stage stage, FrameKind kind, const FrameWork& frame);

/// Milliseconds that the work takes at these rates: memory and processors work at the same time.
double bytes_ms(const StageWork& work, const DeviceRates& rates);
double evaluations_ms(const StageWork& work, const DeviceRates& rates);
double floor_ms(const StageWork& work, const DeviceRates& rates);

}  // namespace catgs

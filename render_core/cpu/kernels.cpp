// Selects the instruction sets. One lane is kept for comparison (Highway's emulation of four lanes
// is something else). Sets that bring us nothing over the next lower one are left out. Later
// versions of Highway know more names.
#define HWY_COMPILE_ALL_ATTAINABLE
#define HWY_BROKEN_EMU128 1
#define HWY_DISABLED_TARGETS                                                                  \
  (HWY_SSE2 | HWY_SSSE3 | HWY_AVX3_DL | HWY_AVX3_ZEN4 | HWY_AVX3_SPR | HWY_NEON_WITHOUT_AES | \
   HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128)
#include <hwy/detect_targets.h>
#ifndef HWY_SSE2
#define HWY_SSE2 0
#define HWY_NEON_WITHOUT_AES 0
#endif
#ifndef HWY_AVX3_ZEN4
#define HWY_AVX3_ZEN4 0
#endif
#ifndef HWY_AVX3_SPR
#define HWY_AVX3_SPR 0
#endif

#include <glm/common.hpp>

#include "render_core/cpu/kernels.h"
#include "render_core/math/camera.h"

// This file is compiled once per instruction set: foreach_target.h includes it again for each.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "render_core/cpu/kernels.cpp"
#include <hwy/foreach_target.h>
// foreach_target.h comes before the headers it repeats.
#include <hwy/highway.h>

#include "render_core/cpu/bin-inl.h"
#include "render_core/cpu/blend-inl.h"
#include "render_core/cpu/limits-inl.h"
#include "render_core/cpu/project-inl.h"

#if HWY_ONCE

namespace catgs {
namespace {

struct Target {
  std::int64_t id;
  SimdKernels kernels;
};

#define CATGS_TARGET(name)                                                                \
  {                                                                                       \
    HWY_##name, {                                                                         \
#name, N_##name::find_limits, N_##name::project_cluster, N_##name::refresh_cluster, \
          N_##name::list_tiles, N_##name::blend_tile                                      \
    }                                                                                     \
  }

const Target compiled_targets[] = {
#if HWY_TARGETS & HWY_AVX3
    CATGS_TARGET(AVX3),
#endif
#if HWY_TARGETS & HWY_AVX2
    CATGS_TARGET(AVX2),
#endif
#if HWY_TARGETS & HWY_SSE4
    CATGS_TARGET(SSE4),
#endif
#if HWY_TARGETS & HWY_NEON
    CATGS_TARGET(NEON),
#endif
    CATGS_TARGET(SCALAR),
};

}  // namespace

std::span<const SimdKernels> simd_kernels() {
  static const std::vector<SimdKernels> supported = [] {
    std::vector<SimdKernels> kernels;
    for (const Target& target : compiled_targets)
      if (target.id == HWY_SCALAR || (hwy::SupportedTargets() & target.id) != 0)
        kernels.push_back(target.kernels);
    return kernels;
  }();
  return supported;
}

}  // namespace catgs

#endif  // HWY_ONCE

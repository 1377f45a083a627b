#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>

#include "render_core/scene/scene.h"

namespace catgs {

class ThreadPool;

/// Procedural scenes with the statistics of a trained capture.
/// city: streets and towers, the public demo; garden: fine vegetation; stress: what breaks
/// renderers (huge, needle-like, nearly transparent, coincident Gaussians).
enum class SynthKind { city, garden, stress };
SynthKind parse_synth_kind(std::string_view name);  // throws InputError

/// A city of 1 M Gaussians or more has full density and grows outwards: what lies in its middle is
/// the same at every size. A smaller one is both smaller and coarser, its surfaces still closed.
/// Units are metres, y points down, the ground lies at y = 0.
///
/// `gaussians` in 1'000…64'000'000; exactly that many come out. The same (kind, count, seed) gives
/// the same bytes on every machine. SH degree 3. Hints hold a start pose worth looking at.
Scene synthesize(SynthKind kind, std::size_t gaussians, std::uint64_t seed);
/// The same on a given pool; its size changes the time alone.
Scene synthesize(SynthKind kind, std::size_t gaussians, std::uint64_t seed, ThreadPool& pool);

}  // namespace catgs

#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string_view>

#include "render_core/scene/scene.h"

namespace catgs {

class ThreadPool;

/// Procedural scenes with the statistics of a trained capture. city: streets and towers, the public
/// demo; garden: fine vegetation; stress: difficult cases for renderers (huge, needle-like, nearly
/// transparent, coincident Gaussians).
enum class SynthKind { city, garden, stress };
SynthKind parse_synth_kind(std::string_view name);  // throws InputError

/// A city of 1 M Gaussians or more has full density and grows outwards; its middle is the same at
/// every size. A smaller one is both smaller and coarser, with closed surfaces. Units are metres, y
/// points down, the ground lies at y = 0.
///
/// `gaussians` in 1'000…64'000'000; exactly that many result. The same (kind, count, seed) gives
/// the same bytes on every machine. SH degree 3. The hints have a start pose with a good view.
Scene synthesize(SynthKind kind, std::size_t gaussians, std::uint64_t seed);
/// The same on a given pool, whose size changes only the time.
Scene synthesize(SynthKind kind, std::size_t gaussians, std::uint64_t seed, ThreadPool& pool);

/// The same Gaussians in their order, in parts that are let go once `take` returns. A city may have
/// up to 2^34 of them and takes a few hundred MB; the others are made whole. Returns the hints.
SceneHints synthesize_parts(SynthKind kind, std::size_t gaussians, std::uint64_t seed,
                            ThreadPool& pool,
                            const std::function<void(const GaussianCloud&)>& take);

}  // namespace catgs

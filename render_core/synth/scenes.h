#pragma once

#include <cstdint>
#include <functional>

#include "render_core/base/thread_pool.h"
#include "render_core/scene/scene.h"

namespace catgs::synth {

// One function per SynthKind: fills a cloud of `count` Gaussians and the hints, its parts in
// parallel on the pool. The result does not depend on the pool.
Scene make_city(std::size_t count, std::uint64_t seed, ThreadPool& pool);
/// The Gaussians of make_city() in their order, about a million at a time.
SceneHints stream_city(std::size_t count, std::uint64_t seed, ThreadPool& pool,
                       const std::function<void(const GaussianCloud&)>& take);
Scene make_garden(std::size_t count, std::uint64_t seed, ThreadPool& pool);
Scene make_stress(std::size_t count, std::uint64_t seed, ThreadPool& pool);

}  // namespace catgs::synth

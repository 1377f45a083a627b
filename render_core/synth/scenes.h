#pragma once

#include <cstdint>

#include "render_core/base/thread_pool.h"
#include "render_core/scene/scene.h"

namespace catgs::synth {

// One function per SynthKind: fills a cloud of `count` Gaussians and the hints, its parts in
// parallel on the pool. The result does not depend on the pool.
Scene make_city(std::size_t count, std::uint64_t seed, ThreadPool& pool);
Scene make_garden(std::size_t count, std::uint64_t seed, ThreadPool& pool);
Scene make_stress(std::size_t count, std::uint64_t seed, ThreadPool& pool);

}  // namespace catgs::synth

#pragma once

#include <memory>
#include <string_view>

#include "render_core/base/thread_pool.h"
#include "render_core/renderer.h"

namespace catgs {

/// The software core: SIMD and threads. `simd` is "auto" or a name of simd_targets(), in any case;
/// throws InputError on any other name. The cloud is copied into the core's own layout.
std::unique_ptr<Renderer> make_cpu_renderer(const GaussianCloud& cloud,
                                            std::shared_ptr<ThreadPool> pool,
                                            std::string_view simd);

/// The same for a scene in pages. `memory_bytes` bounds the pages in memory.
std::unique_ptr<Renderer> make_cpu_renderer(std::shared_ptr<TreeFile> tree,
                                            std::uint64_t memory_bytes,
                                            std::shared_ptr<ThreadPool> pool,
                                            std::string_view simd);

}  // namespace catgs

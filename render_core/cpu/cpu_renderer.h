#pragma once

#include <memory>
#include <string_view>

#include "render_core/base/thread_pool.h"
#include "render_core/frame/renderer.h"

namespace catgs {

/// The software core: SIMD and threads. `simd` is "auto" or a name of simd_kernels(), in any case;
/// throws InputError on any other name. The cloud is copied into the core's own layout.
std::unique_ptr<Renderer> make_cpu_renderer(const GaussianCloud& cloud,
                                            std::shared_ptr<ThreadPool> pool,
                                            std::string_view simd);

/// The same for a scene in pages, with `simd` and the memory for pages from the options.
std::unique_ptr<Renderer> make_cpu_renderer(std::shared_ptr<TreeFile> tree,
                                            const RendererOptions& options,
                                            std::shared_ptr<ThreadPool> pool);

}  // namespace catgs

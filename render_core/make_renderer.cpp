#include <string>
#include <utility>

#include "render_core/cpu/cpu_renderer.h"
#include "render_core/cuda/cuda_renderer.h"
#include "render_core/error.h"
#include "render_core/reference/reference.h"
#include "render_core/renderer.h"
#include "render_core/thread_pool.h"

namespace catgs {

MadeRenderer make_renderer(std::shared_ptr<const GaussianCloud> cloud,
                           const RendererOptions& options) {
  const auto pool = [&options] {
    return options.pool ? options.pool : std::make_shared<ThreadPool>();
  };
  switch (options.kind) {
    case RendererKind::reference:
      return {make_reference_renderer(std::move(cloud), pool()), "asked for"};
    case RendererKind::cpu:
      return {make_cpu_renderer(*cloud, pool(), options.simd), "asked for"};
    case RendererKind::cuda:
      return {make_cuda_renderer(*cloud), "asked for"};
    case RendererKind::automatic:
      break;
  }
  if (const std::string obstacle = cuda_obstacle(); !obstacle.empty()) {
    return {make_cpu_renderer(*cloud, pool(), options.simd), obstacle};
  }
  try {
    return {make_cuda_renderer(*cloud), "a CUDA device is there"};
  } catch (const InputError& error) {
    return {make_cpu_renderer(*cloud, pool(), options.simd), error.what()};
  }
}

}  // namespace catgs

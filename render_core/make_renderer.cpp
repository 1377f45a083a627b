#include <string>
#include <utility>

#include "render_core/cpu/cpu_renderer.h"
#include "render_core/error.h"
#include "render_core/reference/reference.h"
#include "render_core/renderer.h"
#include "render_core/thread_pool.h"

namespace catgs {

MadeRenderer make_renderer(std::shared_ptr<const GaussianCloud> cloud,
                           const RendererOptions& options) {
  auto pool = options.pool ? options.pool : std::make_shared<ThreadPool>();
  switch (options.kind) {
    case RendererKind::reference:
      return {make_reference_renderer(std::move(cloud), std::move(pool)), "asked for"};
    case RendererKind::cpu:
      return {make_cpu_renderer(*cloud, std::move(pool), options.simd), "asked for"};
    case RendererKind::cuda:
      throw InputError("--renderer cuda", "", "this build has no CUDA core", "use auto or cpu");
    case RendererKind::automatic:
      break;
  }
  return {make_cpu_renderer(*cloud, std::move(pool), options.simd), "this build has no CUDA core"};
}

}  // namespace catgs

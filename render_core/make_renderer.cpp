#include <utility>

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
    case RendererKind::cuda:
      throw InputError("--renderer cuda", "", "this build has no CUDA core", "use auto or cpu");
    case RendererKind::automatic:
    case RendererKind::cpu:
      break;
  }
  return {make_reference_renderer(std::move(cloud), std::move(pool)),
          "this build has no CPU core yet"};
}

}  // namespace catgs

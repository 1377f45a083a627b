#include <cassert>
#include <string>
#include <utility>

#include "render_core/base/device_set.h"
#include "render_core/base/error.h"
#include "render_core/base/thread_pool.h"
#include "render_core/cpu/cpu_renderer.h"
#include "render_core/cuda/cuda_renderer.h"
#include "render_core/device_error.h"
#include "render_core/reference/reference.h"
#include "render_core/renderer.h"

namespace catgs {
namespace {

MadeRenderer make_on_devices(const GaussianCloud& cloud, const RendererOptions& options,
                             ThreadPool& pool, std::string reason) {
  MadeRenderer made = make_cuda_renderer(
      cloud, options.devices ? options.devices : std::make_shared<DeviceSet>(), pool);
  made.reason = reason.append(made.reason.empty() ? "" : "; ").append(made.reason);
  return made;
}

}  // namespace

void check(const RendererOptions& options) {
  const bool on_host = options.kind == RendererKind::cpu || options.kind == RendererKind::reference;
  if (on_host && options.devices && !options.devices->all()) {
    throw InputError("--device", "", "chooses among CUDA devices, and --renderer asks for none",
                     "leave one of them out");
  }
}

MadeRenderer make_renderer(std::shared_ptr<const GaussianCloud> cloud,
                           const RendererOptions& options) {
  assert(cloud && cloud->sizes_agree());
  check(options);
  const auto pool = [&options] {
    return options.pool ? options.pool : std::make_shared<ThreadPool>();
  };
  switch (options.kind) {
    case RendererKind::reference:
      return {make_reference_renderer(std::move(cloud), pool()), "asked for"};
    case RendererKind::cpu:
      return {make_cpu_renderer(*cloud, pool(), options.simd), "asked for"};
    case RendererKind::cuda:
      return make_on_devices(*cloud, options, *pool(), "asked for");
    case RendererKind::automatic:
      break;
  }
  if (const std::string obstacle = cuda_obstacle(); !obstacle.empty()) {
    return {make_cpu_renderer(*cloud, pool(), options.simd), obstacle};
  }
  try {
    return make_on_devices(*cloud, options, *pool(), "a CUDA device is there");
  } catch (const DevicesUnusable& error) {
    return {make_cpu_renderer(*cloud, pool(), options.simd), error.what()};
  }
}

}  // namespace catgs

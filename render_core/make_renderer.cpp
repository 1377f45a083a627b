#include <cassert>
#include <string>
#include <utility>

#include "render_core/base/device_set.h"
#include "render_core/base/error.h"
#include "render_core/base/thread_pool.h"
#include "render_core/cpu/cpu_renderer.h"
#include "render_core/cuda/cuda_renderer.h"
#include "render_core/frame/device_error.h"
#include "render_core/frame/renderer.h"
#include "render_core/reference/reference.h"

namespace catgs {
namespace {

std::shared_ptr<ThreadPool> pool_of(const RendererOptions& options) {
  return options.pool ? options.pool : std::make_shared<ThreadPool>();
}

std::shared_ptr<DeviceSet> devices_of(const RendererOptions& options) {
  return options.devices ? options.devices : std::make_shared<DeviceSet>();
}

/// `on_host` and `on_devices` make the two cores.
template <class OnHost, class OnDevices>
MadeRenderer choose_core(const RendererOptions& options, const OnHost& on_host,
                         const OnDevices& on_devices) {
  const auto with_reason = [&](std::string reason) {
    MadeRenderer made = on_devices();
    made.reason = reason.append(made.reason.empty() ? "" : "; ").append(made.reason);
    return made;
  };
  if (options.kind == RendererKind::cpu) return {on_host(), "asked for"};
  if (options.kind == RendererKind::cuda) return with_reason("asked for");
  if (const std::string obstacle = cuda_obstacle(); !obstacle.empty()) return {on_host(), obstacle};
  try {
    return with_reason("a CUDA device is there");
  } catch (const DevicesUnusable& error) {
    return {on_host(), error.what()};
  }
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
  const std::shared_ptr<ThreadPool> pool = pool_of(options);
  if (options.kind == RendererKind::reference)
    return {make_reference_renderer(std::move(cloud), pool), "asked for"};
  return choose_core(
      options, [&] { return make_cpu_renderer(*cloud, pool, options.simd); },
      [&] { return make_cuda_renderer(*cloud, devices_of(options), *pool); });
}

MadeRenderer make_renderer(std::shared_ptr<TreeFile> tree, const RendererOptions& options) {
  assert(tree);
  check(options);
  if (options.kind == RendererKind::reference)
    throw InputError("--renderer reference", "", "draws whole scenes only, not parts of a tree",
                     "leave --detail and --scene-memory out");
  return choose_core(
      options, [&] { return make_cpu_renderer(tree, options, pool_of(options)); },
      [&] { return make_cuda_renderer(tree, options, devices_of(options)); });
}

}  // namespace catgs

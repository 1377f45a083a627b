#include "render_core/cpu/cpu_renderer.h"

#include <algorithm>
#include <cctype>
#include <string>
#include <utility>

#include "render_core/base/error.h"
#include "render_core/cpu/cpu_view.h"

namespace catgs {
namespace {

class CpuRenderer final : public Renderer {
 public:
  explicit CpuRenderer(std::shared_ptr<const CpuScene> scene) : scene_(std::move(scene)) {}

  std::string description() const override {
    const int threads = scene_->pool->threads();
    return "CPU, " + std::string(scene_->kernels.name) + ", " + std::to_string(threads) +
           (threads == 1 ? " thread" : " threads");
  }
  std::size_t scene_bytes() const override {
    return scene_->tree ? scene_->tree->figures().pool_bytes : scene_->store().bytes();
  }
  std::vector<PageFigures> pages() const override {
    if (!scene_->tree) return {};
    return {scene_->tree->figures()};
  }
  std::unique_ptr<View> make_view(const ViewSettings& settings) override {
    return std::make_unique<CpuView>(scene_, settings);
  }

 private:
  std::shared_ptr<const CpuScene> scene_;
};

const SimdKernels& choose_kernels(std::string_view simd) {
  const std::span<const SimdKernels> all = simd_kernels();
  const auto same = [](std::string_view a, std::string_view b) {
    return std::ranges::equal(
        a, b, {}, [](unsigned char c) { return std::tolower(c); },
        [](unsigned char c) { return std::tolower(c); });
  };
  if (same(simd, "auto")) return all.front();
  std::string names;
  for (const SimdKernels& kernels : all) {
    if (same(simd, kernels.name)) return kernels;
    names.append(", ").append(kernels.name);
  }
  throw InputError("--simd", "", "this machine has no \"" + std::string(simd) + "\"",
                   "use auto" + names);
}

}  // namespace

std::unique_ptr<Renderer> make_cpu_renderer(const GaussianCloud& cloud,
                                            std::shared_ptr<ThreadPool> pool,
                                            std::string_view simd) {
  const SimdKernels& kernels = choose_kernels(simd);
  auto scene = std::make_shared<CpuScene>();
  scene->whole.emplace(cloud, *pool);
  scene->pool = std::move(pool);
  scene->kernels = kernels;
  return std::make_unique<CpuRenderer>(std::move(scene));
}

std::unique_ptr<Renderer> make_cpu_renderer(std::shared_ptr<TreeFile> tree,
                                            const RendererOptions& options,
                                            std::shared_ptr<ThreadPool> pool) {
  auto scene = std::make_shared<CpuScene>();
  scene->kernels = choose_kernels(options.simd);
  scene->pool = std::move(pool);
  auto pages = host_pool(tree->shape(), options);
  scene->pages = std::make_unique<PageSlots>(tree->shape(), tree->model(), pages->slots());
  scene->tree = std::make_unique<PagedTree>(std::move(pages), std::move(tree), *scene->pages);
  return std::make_unique<CpuRenderer>(std::move(scene));
}

}  // namespace catgs

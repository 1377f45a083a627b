#pragma once

#include <memory>
#include <string>
#include <utility>

#include "render_core/frame/renderer.h"
#include "render_core/scene/tree/page_pools.h"
#include "render_core/scene/tree/read_tree.h"
#include "tests/render_core/cores/core_test.h"
#include "tests/render_core/scene/tree/tree_test_support.h"
#include "tests/support/test_scenes.h"

namespace catgs::test {

/// A scene of 60,000 Gaussians as a tree, and all its leaves as a cloud.
struct TreeScenes {
  explicit TreeScenes(int sh_degree = 1, std::uint32_t seed = 21)
      : bytes(tree_bytes(random_cloud(60'000, sh_degree, seed), pool)) {
    cloud =
        std::make_shared<const GaussianCloud>(read_tree(source_of(bytes), LoadContext(pool)).cloud);
  }
  [[nodiscard]] std::shared_ptr<TreeFile> tree() const {
    return std::make_shared<TreeFile>(source_of(bytes));
  }
  [[nodiscard]] std::unique_ptr<Renderer> in_pages(std::uint64_t memory_bytes = 1u << 28,
                                                   RendererKind kind = core) const {
    RendererOptions options;
    options.kind = kind;
    options.scene_memory = memory_bytes;
    return make_renderer(tree(), options).renderer;
  }
  /// In a pool that it shares.
  [[nodiscard]] std::unique_ptr<Renderer> in_pages(std::shared_ptr<PagePools> pages) const {
    RendererOptions options;
    options.kind = core;
    options.pages = std::move(pages);
    return make_renderer(tree(), options).renderer;
  }
  [[nodiscard]] std::unique_ptr<Renderer> whole() const { return core_renderer_of(cloud); }

  ThreadPool pool{2};
  std::string bytes;
  std::shared_ptr<const GaussianCloud> cloud;
};

inline FrameRequest tree_request(float distance, float detail_px) {
  FrameRequest request;
  request.camera = make_camera(look_at({0, 0, 5 - distance}, {0, 0, 5}), {320, 192}, 300.0f);
  request.detail_px = detail_px;
  request.waits_for_pages = true;
  return request;
}

}  // namespace catgs::test

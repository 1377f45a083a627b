#pragma once

#include <memory>
#include <string>
#include <utility>

#include <gtest/gtest.h>

#include "render_core/cuda/cuda_renderer.h"
#include "render_core/frame/renderer.h"

namespace catgs::test {

/// The core that this program tests: the sources of this folder are compiled for each one.
inline constexpr RendererKind core = RendererKind::CATGS_CORE;

/// Skips its tests where no device is, with the core's own reason.
class CoreTest : public testing::Test {
 protected:
  void SetUp() override {
    const std::string obstacle = core == RendererKind::cuda ? cuda_obstacle() : "";
    if (!obstacle.empty()) GTEST_SKIP() << obstacle;
  }
};

inline std::unique_ptr<Renderer> core_renderer_of(std::shared_ptr<const GaussianCloud> cloud,
                                                  RendererKind kind = core) {
  return make_renderer(std::move(cloud), {.kind = kind, .pool = {}}).renderer;
}

}  // namespace catgs::test

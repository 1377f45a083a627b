#pragma once

#include <memory>
#include <span>
#include <vector>

#include "render_core/base/thread_pool.h"
#include "render_core/frame/renderer.h"

namespace catgs {

/// The oracle: every pixel against every Gaussian, in double precision, no tiles. Its
/// cost is pixels x visible Gaussians; judge large scenes by a subset of pixels.
///
/// Returns the colour of each pixel (column, row), clamped to [0, 1]. The request must pass
/// check_request().
std::vector<glm::dvec3> render_reference_pixels(const GaussianCloud& cloud,
                                                const FrameRequest& request,
                                                std::span<const glm::ivec2> pixels,
                                                ThreadPool& pool);

/// `count` different pixels of an image, drawn with `seed`, in row order; all of them when the
/// image has no more.
std::vector<glm::ivec2> random_pixels(glm::ivec2 size_px, std::size_t count, std::uint64_t seed);

/// The oracle as a Renderer. It has one pipeline and ignores the one that a View asks for.
std::unique_ptr<Renderer> make_reference_renderer(std::shared_ptr<const GaussianCloud> cloud,
                                                  std::shared_ptr<ThreadPool> pool);

}  // namespace catgs

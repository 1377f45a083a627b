#pragma once

#include <cstdint>
#include <memory>
#include <ostream>
#include <string>
#include <vector>

#include "render_core/frame/renderer.h"
#include "render_core/math/camera.h"
#include "render_core/scene/gaussian_cloud.h"

namespace catgs::test {

/// A small scene and a camera that looks at it.
struct TestScene {
  std::string name;
  std::shared_ptr<const GaussianCloud> cloud;
  FrameRequest request;
};
inline void PrintTo(const TestScene& scene, std::ostream* out) { *out << scene.name; }

/// Scenes small enough for the reference that hold what breaks renderers: near-plane crossings,
/// Gaussians larger than the image, needles, nothing at all, one pixel, odd sizes, coincident
/// centres, exact depth ties, faint and nearly opaque ones, cameras far from the origin; and each
/// SplatModel.
std::vector<TestScene> small_scenes();

/// `count` Gaussians around (0, 0, 5) with axis ratios up to 30 and SH of `degree`.
GaussianCloud random_cloud(std::size_t count, int degree, std::uint64_t seed);

/// Pose at `position` looking at `target`, image y along `down`.
Pose look_at(glm::vec3 position, glm::vec3 target, glm::vec3 down = {0, 1, 0});

/// The pixels of an rgb_f32 frame, row after row.
std::vector<float> copy_rgb(const FrameView& frame);

/// Peak signal-to-noise ratio of two images with values in [0, 1], dB; infinite when equal.
double psnr_db(const std::vector<float>& a, const std::vector<float>& b);

}  // namespace catgs::test

#pragma once

#include <memory>
#include <vector>

#include "render_core/base/thread_pool.h"
#include "render_core/frame/renderer.h"

namespace catgs {

/// Pixels have these values besides their colour, row by row; empty where not asked for.
struct FrameLayers {
  std::vector<float> alpha;  // 1 - the transmittance left for the background
  std::vector<float> depth;  // mean view depth, world units; 0 where nothing is seen
};

/// Draws the layers of frames with the CPU core, whatever core draws the colours. Each Gaussian
/// gets a place or white as its colour, so that the blend averages places or adds up weights. Holds
/// one or two more copies of the scene, without harmonics.
class LayerRenderer {
 public:
  LayerRenderer(const GaussianCloud& cloud, bool alpha, bool depth,
                const std::shared_ptr<ThreadPool>& pool);

  /// Throws std::runtime_error.
  FrameLayers render(const Camera& camera);

 private:
  /// The scene in other colours.
  struct Recoloured {
    std::unique_ptr<Renderer> renderer;
    std::unique_ptr<View> view;
  };
  /// `colours` are in [0, 1].
  static Recoloured recolour(const GaussianCloud& cloud, const std::vector<glm::vec3>& colours,
                             const std::shared_ptr<ThreadPool>& pool);

  bool alpha_;
  Recoloured white_, positions_;  // the second is empty without depth
  glm::vec3 low_{0.0f};
  glm::vec3 extent_{1.0f};  // a place is low_ + colour * extent_
};

}  // namespace catgs

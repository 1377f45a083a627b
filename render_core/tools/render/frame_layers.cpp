#include "render_core/tools/render/frame_layers.h"

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "render_core/image/png.h"
#include "render_core/scene/activations.h"
#include "render_core/tools/render_setup.h"

namespace catgs {
namespace {

Image draw(View& view, const Camera& camera) {
  FrameView frame;
  render_or_throw(view, {.camera = camera}, frame);
  return copy_image(frame);
}

}  // namespace

LayerRenderer::Recoloured LayerRenderer::recolour(const GaussianCloud& cloud,
                                                  const std::vector<glm::vec3>& colours,
                                                  const std::shared_ptr<ThreadPool>& pool) {
  auto copy = std::make_shared<GaussianCloud>();
  copy->mean = cloud.mean;
  copy->rotation = cloud.rotation;
  copy->scale = cloud.scale;
  copy->opacity = cloud.opacity;
  copy->sh.reserve(colours.size());
  for (const glm::vec3& colour : colours) copy->sh.push_back((colour - 0.5f) / sh_c0);
  Recoloured made;
  made.renderer =
      make_renderer(std::move(copy), {.kind = RendererKind::cpu, .pool = pool}).renderer;
  made.view = made.renderer->make_view({});
  return made;
}

LayerRenderer::LayerRenderer(const GaussianCloud& cloud, bool alpha, bool depth,
                             const std::shared_ptr<ThreadPool>& pool)
    : alpha_(alpha) {
  std::vector<glm::vec3> colours(cloud.size(), glm::vec3(1.0f));
  white_ = recolour(cloud, colours, pool);
  if (!depth || cloud.empty()) return;
  glm::vec3 high = cloud.mean.front();
  low_ = high;
  for (const glm::vec3& mean : cloud.mean) {
    low_ = glm::min(low_, mean);
    high = glm::max(high, mean);
  }
  extent_ = glm::max(high - low_, glm::vec3(1e-6f));
  for (std::size_t i = 0; i < cloud.size(); ++i) colours[i] = (cloud.mean[i] - low_) / extent_;
  positions_ = recolour(cloud, colours, pool);
}

FrameLayers LayerRenderer::render(const Camera& camera) {
  constexpr float seen = 1.0f / 255.0f;
  const Image white = draw(*white_.view, camera);
  FrameLayers layers;
  for (std::size_t i = 0; alpha_ && i < white.rgb.size(); i += 3)
    layers.alpha.push_back(white.rgb[i]);
  if (!positions_.view) return layers;
  const Image positions = draw(*positions_.view, camera);
  const Pose& pose = camera.world_from_camera;
  const glm::vec3 forward = pose.orientation * glm::vec3(0.0f, 0.0f, 1.0f);
  for (std::size_t i = 0; i < positions.rgb.size(); i += 3) {
    const glm::vec3 sum(positions.rgb[i], positions.rgb[i + 1], positions.rgb[i + 2]);
    const float weight = white.rgb[i];
    const glm::vec3 point = low_ + sum / std::max(weight, seen) * extent_;
    layers.depth.push_back(weight < seen ? 0.0f : glm::dot(forward, point - pose.position));
  }
  return layers;
}

}  // namespace catgs

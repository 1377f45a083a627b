#include "render_core/scene/tree/cut.h"

#include <algorithm>
#include <limits>
#include <tuple>

#include "render_core/scene/clusters.h"

namespace catgs {
namespace {

constexpr float unbounded_px = std::numeric_limits<float>::infinity();

/// A camera as the walk through the tree sees it.
struct Eye {
  explicit Eye(const Camera& camera)
      : culler(camera),
        position(camera.world_from_camera.position),
        forward(camera.world_from_camera.orientation * glm::vec3(0.0f, 0.0f, 1.0f)),
        focal_px(std::max(camera.focal_px.x, camera.focal_px.y)),
        near_z(camera.near_z) {}

  ClusterCuller culler;
  glm::vec3 position, forward;
  float focal_px, near_z;
};

/// Largest error of a node in pixels over the cameras that may see it; negative: none does.
float visible_error_px(std::span<const Eye> eyes, const NodeFacts& facts) {
  if (eyes.empty()) return unbounded_px;
  float largest = -1.0f;
  for (const Eye& eye : eyes)
    if (!eye.culler.outside(facts.bounds))
      largest = std::max(largest, error_px(facts.error, facts.bounds, eye.position, eye.forward,
                                           eye.focal_px, eye.near_z));
  return largest;
}

}  // namespace

Cut choose_cut(const TreeShape& shape, std::span<const Camera> cameras, float detail_px,
               const ResidentPage& resident) {
  Cut cut;
  const std::vector<Eye> eyes(cameras.begin(), cameras.end());
  if (!resident(shape.page_of(shape.root()))) {
    cut.missing.push_back({shape.page_of(shape.root()), unbounded_px});
    return cut;
  }
  std::vector<NodeId> stack = {shape.root()};
  while (!stack.empty()) {
    const NodeId node = stack.back();
    stack.pop_back();
    const NodeFacts* facts = resident(shape.page_of(node));
    const float error = visible_error_px(eyes, facts[shape.slot_of(node)]);
    if (error < 0.0f) continue;
    if (node.level == 0 || error < detail_px) {
      cut.drawn.push_back(node);
      continue;
    }
    const auto below = static_cast<std::uint8_t>(node.level - 1);
    const NodeId children[2] = {{below, 2 * node.index}, {below, 2 * node.index + 1}};
    const std::size_t count = children[1].index < shape.nodes_on(below) ? 2 : 1;
    bool whole = true;
    for (const NodeId& child : std::span(children).first(count))
      if (!resident(shape.page_of(child))) {
        cut.missing.push_back({shape.page_of(child), error});
        whole = false;
      }
    if (!whole) {
      cut.drawn.push_back(node);
      continue;
    }
    for (std::size_t i = count; i-- > 0;) stack.push_back(children[i]);
  }
  std::ranges::sort(cut.missing, [](const MissingPage& a, const MissingPage& b) {
    return std::tie(b.error_px, a.page) < std::tie(a.error_px, b.page);
  });
  return cut;
}

}  // namespace catgs

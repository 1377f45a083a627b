#include "render_core/scene/files/scene_by_parts.h"

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

#include "render_core/scene/formats/load_context.h"
#include "render_core/scene/tree/read_tree.h"

namespace catgs {

SceneByParts by_parts(PartedScene scene) {
  return {std::move(scene.hints), std::make_shared<GaussianCloud>(std::move(scene.sample)),
          [each = std::move(scene.parts.each)](const auto& take) { each(take); }};
}

SceneByParts by_parts(Scene scene) {
  const auto cloud = std::make_shared<const GaussianCloud>(std::move(scene.cloud));
  return {std::move(scene.hints), cloud, [cloud](const auto& take) { take(*cloud); }};
}

SceneByParts by_parts(const SceneInPages& scene, std::shared_ptr<ThreadPool> pool) {
  const auto each = [tree = scene.tree, pool = std::move(pool)](const auto& take) {
    constexpr std::uint32_t leaves_of_part = 1024;
    const std::uint32_t leaves = tree->shape().leaves();
    for (std::uint32_t first = 0; first < leaves; first += leaves_of_part) {
      std::vector<NodeId> nodes;
      for (std::uint32_t k = first; k < std::min(leaves, first + leaves_of_part); ++k)
        nodes.push_back({0, k});
      take(read_nodes(*tree, nodes, LoadContext(*pool)));
    }
  };
  return {scene.outline.hints, std::make_shared<GaussianCloud>(scene.outline.cloud), each};
}

}  // namespace catgs

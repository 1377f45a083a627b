#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "render_core/base/host_device.h"
#include "render_core/math/camera.h"
#include "render_core/scene/tree/tree_shape.h"

namespace catgs {

/// An upper bound of a node's error in pixels: error x focal / the depth of the nearest point of
/// its box. Infinite where that point is nearer than the near plane. `forward` is the camera's view
/// axis in the world, unit.
CATGS_HD inline float error_px(float error, const Cluster& bounds, const glm::vec3& position,
                               const glm::vec3& forward, float focal_px, float near_z) {
  const float centre = forward.x * (bounds.centre.x - position.x) +
                       forward.y * (bounds.centre.y - position.y) +
                       forward.z * (bounds.centre.z - position.z);
  const float nearest =
      centre - (fabsf(forward.x) * bounds.half_extent.x + fabsf(forward.y) * bounds.half_extent.y +
                fabsf(forward.z) * bounds.half_extent.z);
  // The magnitude of infinity is fixed, so that device code needs no library for it.
  return nearest > near_z ? error * focal_px / nearest : 3e38f;
}

/// A page that a cut would refine a node with.
struct MissingPage {
  std::uint64_t page = 0;
  float error_px = 0.0f;  // of the node that is drawn meanwhile
};

struct Cut {
  std::vector<NodeId> drawn;         // in the order of the leaves that they stand for
  std::vector<MissingPage> missing;  // largest error first
};

/// The facts of a page's slots if its blocks are in memory, else null. They stay valid during
/// choose_cut().
using ResidentPage = std::function<const NodeFacts*(std::uint64_t page)>;

/// The nodes to draw for all `cameras` at once, with a detail of `detail_px`: a node is drawn when
/// its error is under `detail_px` in every camera that it may be visible in, or when a page of its
/// children is not resident. Else its children are looked at. Nodes outside of all cameras' views
/// are left out with all that they stand for. So every leaf that may be visible has exactly one
/// node drawn, itself or an ancestor, and `detail_px` = 0 gives all leaves that are resident.
/// Without cameras nothing is outside, and every error is infinite. Nothing is drawn while the
/// root's page is missing.
Cut choose_cut(const TreeShape& shape, std::span<const Camera> cameras, float detail_px,
               const ResidentPage& resident);

}  // namespace catgs

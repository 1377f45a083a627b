#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "render_core/base/host_device.h"
#include "render_core/math/camera.h"
#include "render_core/math/constants.h"
#include "render_core/scene/tree/tree_shape.h"

namespace catgs {

/// A camera as a cut sees it.
struct CutEye {
  explicit CutEye(const Camera& camera)
      : position(camera.world_from_camera.position),
        forward(camera.world_from_camera.orientation * glm::vec3(0.0f, 0.0f, 1.0f)),
        focal_px(std::max(camera.focal_px.x, camera.focal_px.y)),
        near_z(camera.near_z) {
    // The corner farthest from the axis decides, as far out as projections are exact.
    const glm::vec2 centre = camera.principal_point_px, size(camera.size_px);
    const glm::vec2 slope = static_cast<float>(fov_clamp) *
                            glm::max(glm::abs(centre), glm::abs(size - centre)) /
                            glm::vec2(camera.focal_px);
    least_cosine = 1.0f / std::sqrt(1.0f + slope.x * slope.x + slope.y * slope.y);
    if (!camera.orthographic) return;
    // All depths are as one, where an error has focal_px pixels.
    forward = glm::vec3(0.0f);
    least_cosine = behind = 0.0f;
    near_z = 1.0f;
  }

  /// A lower bound of the depths of a box's points in view: the near plane's, the depth of the box,
  /// and its distance times the cosine of the widest angle in view.
  [[nodiscard]] CATGS_HD float least_depth(const Cluster& bounds) const {
    const float x = bounds.centre.x - position.x, y = bounds.centre.y - position.y,
                z = bounds.centre.z - position.z;
    const float depth =
        forward.x * x + forward.y * y + forward.z * z -
        (fabsf(forward.x) * bounds.half_extent.x + fabsf(forward.y) * bounds.half_extent.y +
         fabsf(forward.z) * bounds.half_extent.z);
    const float out_x = fmaxf(fabsf(x) - bounds.half_extent.x, 0.0f),
                out_y = fmaxf(fabsf(y) - bounds.half_extent.y, 0.0f),
                out_z = fmaxf(fabsf(z) - bounds.half_extent.z, 0.0f);
    const float distance = sqrtf(out_x * out_x + out_y * out_y + out_z * out_z);
    return fmaxf(fmaxf(depth, least_cosine * distance), near_z);
  }

  /// An upper bound of a node's error in pixels. It grows towards the root.
  [[nodiscard]] CATGS_HD float error_px(float error, const Cluster& bounds) const {
    return error * focal_px / least_depth(bounds);
  }

  /// A node's error in pixels where its Gaussians are, about: behind the nearest point of its box.
  /// A large box around the camera has little beside it, so that the bound counts it for too much.
  [[nodiscard]] float typical_px(float error, const Cluster& bounds) const {
    return error * focal_px / (least_depth(bounds) + behind * glm::length(bounds.half_extent));
  }

  glm::vec3 position, forward;  // world; the view axis, unit
  float focal_px, near_z;
  float least_cosine;   // between the axis and what is in view
  float behind = 0.1f;  // see typical_px(); of a box's half diagonal
};

/// Below this share of the wanted detail, an error is not worth a node's children. From there to
/// the detail itself, a node gives way to its children little by little, so that nothing pops.
inline constexpr float blend_begin = 0.9f;

/// The part of a node that its children have taken over, 0 to 1, for its error in pixels.
CATGS_HD inline float split_share(float error_px, float detail_px) {
  const float begin = blend_begin * detail_px;
  if (error_px >= detail_px) return 1.0f;
  return error_px <= begin ? 0.0f : (error_px - begin) / (detail_px - begin);
}

/// The part of a page's nodes that is shown when the page has been in memory for so long, 0 to 1.
/// All of it is shown after all_shown_s.
inline constexpr double all_shown_s = 0.1;
CATGS_HD inline float shown_share(double seconds) {
  const double share = seconds / all_shown_s;
  return share >= 1.0 ? 1.0f : share > 0.0 ? static_cast<float>(share) : 0.0f;
}

/// A node to draw. Where its share is under 1, ancestors or descendants are drawn in the same
/// place, and the shares along each path from the root to a leaf sum to 1.
struct DrawnNode {
  NodeId node;
  float share = 1.0f;  // see math/fade-inl.h
};

/// A page, and the error of the node that it refines, as the cut's cameras see it.
struct PageUse {
  std::uint64_t page = 0;
  float typical_px = 0.0f;  // no more than that of the nodes above; memory goes by it
  float error_px = 0.0f;    // the bound
};

struct Cut {
  std::vector<DrawnNode>
      drawn;  // in the order of the leaves that they stand for, coarse ones first
  std::vector<std::uint32_t> slots;  // PageInMemory::slot of each of them
  std::vector<PageUse> used;         // pages whose nodes were looked at, without that of the root
  std::vector<PageUse> missing;      // pages that would refine a node, largest error first
};

/// A page in memory. `facts`: of its slots, valid during choose_cut(); null: it is not there.
/// `shown`: the part of its nodes that may be shown, no more than that of the page above.
struct PageInMemory {
  const NodeFacts* facts = nullptr;
  float shown = 1.0f;
  std::uint32_t slot = 0;  // of the core's memory; handed on to Cut::slots
};
using FindPage = std::function<PageInMemory(std::uint64_t page)>;

/// The wanted parts of a cut: all, or those that a frame or a pool needs.
struct CutParts {
  enum class Part { all, drawn, pages };
  Part part = Part::all;  // pages: those used and missing. Pages of leaves are not looked into
  // Whether all in these bounds is hidden; empty: nothing is known of that. Hidden nodes are left
  // out with all that they stand for.
  std::function<bool(const Cluster&)> hides{};
};

/// The nodes to draw for all `cameras` at once, with a detail of `detail_px`. A node whose error
/// reaches the detail in a camera that it may be visible in gives way to its children, if all of
/// them are in memory. Nodes outside of all cameras' views are left out with all that they stand
/// for. So the shares sum to 1 over each leaf that may be visible and its ancestors. No error over
/// `detail_px` is drawn unless pages are missing, and `detail_px` = 0 gives all leaves in memory.
/// Without cameras nothing is outside, and every error is infinite. Nothing is drawn while the
/// root's page is missing.
Cut choose_cut(const TreeShape& shape, std::span<const Camera> cameras, float detail_px,
               const FindPage& find, const CutParts& parts = {});

}  // namespace catgs

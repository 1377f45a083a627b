#pragma once

#include <optional>
#include <vector>

#include <glm/vec3.hpp>

#include "render_core/frame/renderer.h"
#include "render_core/scene/analysis/surface_points.h"
#include "server/base/rate_limit.h"
#include "server/net/messages.h"

namespace catgs {

/// Finds which of a client's markers are behind something, by a ray to each of them. A turning
/// camera costs nothing: the answer depends on where the camera is alone. Not thread-safe.
class MarkerVisibility {
 public:
  /// Forgets the markers of before.
  void watch(Markers markers);
  /// Call it often. Tests the markers before the camera that have not been tested from about there,
  /// as many as the limits allow. Returns all hidden ones if that is new, once all were tested.
  std::optional<HiddenMarkers> test(const SurfacePoints& surface, const PoseSample& camera,
                                    const ClipBox& clip, TimePoint now);

 private:
  struct Marker {
    glm::vec3 point;
    std::optional<glm::vec3> tested_from;
    bool hidden = false;
  };
  std::uint32_t id_ = 0;
  std::vector<Marker> markers_;
  std::size_t next_ = 0;  // the marker whose turn it is
  ClipBox clip_;          // of the tests
  std::optional<std::vector<std::uint32_t>> told_;
  std::optional<TimePoint> last_;  // test
  std::optional<RateLimit> rays_;
};

}  // namespace catgs

#include "render_core/motion/anchor.h"

#include "render_core/motion/script_parts.h"

namespace catgs {

Trajectory anchored(const Trajectory& trajectory, const SceneHints& hints) {
  if (trajectory.empty()) return {};
  SceneHints recorded;  // up is -y
  recorded.start_pose = trajectory.front().world_from_camera;
  const SceneFrame from(recorded), to(hints);
  const glm::dquat turn = to.world_from_ground() * glm::conjugate(from.world_from_ground());
  Trajectory moved = trajectory;
  for (TimedPose& pose : moved) {
    Pose& p = pose.world_from_camera;
    p.position = glm::vec3(to.start() + turn * (glm::dvec3(p.position) - from.start()));
    p.orientation = glm::quat(turn * glm::dquat(p.orientation));
  }
  return moved;
}

}  // namespace catgs

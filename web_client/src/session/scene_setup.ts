import type { SceneSetup } from '../camera/camera_controller';
import type { SceneFacts } from '../wire/wire';

/** Facts that a server left out are the wire's zeros; the camera needs a usable scene. */
export function scene_setup(scene: SceneFacts): SceneSetup {
  const vec = (v: { x: number; y: number; z: number } | undefined) =>
    [v?.x ?? 0, v?.y ?? 0, v?.z ?? 0] as const;
  const q = scene.startPose?.orientation;
  return {
    up: vec(scene.up),
    start_pose: {
      position: vec(scene.startPose?.position),
      orientation: [q?.x ?? 0, q?.y ?? 0, q?.z ?? 0, q?.w ?? 1],
    },
    focus: vec(scene.focus),
    limits_min: vec(scene.limitsMin),
    limits_max: vec(scene.limitsMax),
    near_z: scene.nearZ,
  };
}

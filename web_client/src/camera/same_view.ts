import { length, sub } from '../base/vector';
import type { Pose } from './eye';
import type { SceneSetup } from './scene_setup';

/** A hundredth of a pixel at a focal length of 1000 px. */
export const same_angle_rad = 1e-5;
const single_precision = 2 ** -22; // relative; poses come back from the wire in 32 bits

/** Whether two poses in a scene show the same picture to the eye. */
export function same_view(
  a: Pose,
  b: Pose,
  scene: Pick<SceneSetup, 'near_z' | 'origin'> | undefined,
): boolean {
  const { near_z = 0, origin = [0, 0, 0] } = scene ?? {};
  // For unit quaternions |qa - qb| or |qa + qb| is half the angle between them.
  const difference = Math.hypot(...a.orientation.map((v, i) => v - b.orientation[i]!));
  const sum = Math.hypot(...a.orientation.map((v, i) => v + b.orientation[i]!));
  const tolerance = same_angle_rad * near_z + single_precision * length(sub(b.position, origin));
  return (
    2 * Math.min(difference, sum) <= same_angle_rad + 2 * single_precision &&
    length(sub(a.position, b.position)) <= tolerance
  );
}

import { length, sub } from '../base/vector';
import type { Pose } from './eye';

/** A hundredth of a pixel at a focal length of 1000 px. */
export const same_angle_rad = 1e-5;
const single_precision = 2 ** -22; // relative; poses come back from the wire in 32 bits

/** Whether two poses show the same picture to the eye; `near_z` in world units. */
export function same_view(a: Pose, b: Pose, near_z: number): boolean {
  // For unit quaternions |qa - qb| or |qa + qb| is half the angle between them.
  const difference = Math.hypot(...a.orientation.map((v, i) => v - b.orientation[i]!));
  const sum = Math.hypot(...a.orientation.map((v, i) => v + b.orientation[i]!));
  const tolerance = same_angle_rad * near_z + single_precision * length(b.position);
  return (
    2 * Math.min(difference, sum) <= same_angle_rad + 2 * single_precision &&
    length(sub(a.position, b.position)) <= tolerance
  );
}

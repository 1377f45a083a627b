// Converts between points of the view and rays in the scene. Pure.
import {
  add,
  conjugate,
  cross,
  dot,
  forward,
  length,
  normalize,
  rotate,
  scale,
  sub,
  type Vec3,
} from '../base/vector';
import type { Eye } from './eye';

export interface Ray {
  readonly origin: Vec3;
  readonly direction: Vec3;
}

/** Ray through a point of the view. `x`, `y`: shares of its width and height, y down. */
export function ray_through(eye: Eye, x: number, y: number, aspect: number): Ray {
  const tan = Math.tan(eye.fov_y_rad / 2);
  const inside = normalize([(2 * x - 1) * tan * aspect, (2 * y - 1) * tan, 1], forward);
  return { origin: eye.position, direction: rotate(eye.orientation, inside) };
}

/** Place of a point of the scene in the view, as in ray_through(); undefined behind the camera. */
export function project(
  point: Vec3,
  eye: Eye,
  aspect: number,
): readonly [number, number] | undefined {
  const [x, y, z] = rotate(conjugate(eye.orientation), sub(point, eye.position));
  if (z <= 1e-6) return undefined;
  const tan = Math.tan(eye.fov_y_rad / 2);
  return [0.5 + x / z / tan / aspect / 2, 0.5 + y / z / tan / 2];
}

/** Which way a point is from the middle of the view: right and down, of length 1 (or 0: straight ahead). */
export function direction_to(point: Vec3, eye: Eye): readonly [right: number, down: number] {
  const [x, y] = rotate(conjugate(eye.orientation), sub(point, eye.position));
  const n = Math.hypot(x, y);
  return n > 0 ? [x / n, y / n] : [0, 0];
}

/** The middle of a surface and its normal (unit, towards the eye). */
interface Surface {
  readonly point: Vec3;
  readonly normal: Vec3;
}

/**
 * The surface around the middle of the view, by its points left, right, above and below of it; undefined
 * where one is missing or they span no plane.
 */
export function surface_of(points: readonly (Vec3 | undefined)[], eye: Vec3): Surface | undefined {
  const [left, right, top, bottom] = points;
  if (!left || !right || !top || !bottom) return undefined;
  const point = scale([left, right, top, bottom].reduce(add), 0.25);
  const across = cross(sub(right, left), sub(bottom, top));
  if (!(length(across) > 0)) return undefined;
  const side = dot(across, sub(eye, point)) < 0 ? -1 : 1;
  return { point, normal: normalize(scale(across, side), forward) };
}

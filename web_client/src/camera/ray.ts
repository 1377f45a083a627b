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
import { half_height, half_height_at, type Eye } from './eye';

export interface Ray {
  readonly origin: Vec3;
  readonly direction: Vec3;
}

/** Ray through a point of the view. `x`, `y`: shares of its width and height, y down. */
export function ray_through(eye: Eye, x: number, y: number, aspect: number): Ray {
  const half = half_height(eye);
  const [right, down] = [(2 * x - 1) * half * aspect, (2 * y - 1) * half];
  const turned = (v: Vec3): Vec3 => rotate(eye.orientation, v);
  if (eye.view_height !== undefined)
    return { origin: add(eye.position, turned([right, down, 0])), direction: turned(forward) };
  return { origin: eye.position, direction: turned(normalize([right, down, 1], forward)) };
}

/** Place of a point of the scene in the view, as in ray_through(); undefined behind the camera. */
export function project(
  point: Vec3,
  eye: Eye,
  aspect: number,
): readonly [number, number] | undefined {
  const [x, y, z] = rotate(conjugate(eye.orientation), sub(point, eye.position));
  if (z <= 1e-6) return undefined;
  const half = half_height_at(eye, z);
  return [0.5 + x / half / aspect / 2, 0.5 + y / half / 2];
}

/** Side of a pixel at a point of the scene, where the view has so many rows. */
export function pixel_at(point: Vec3, eye: Eye, height_px: number): number {
  const depth = dot(sub(point, eye.position), rotate(eye.orientation, forward));
  return (2 * half_height_at(eye, depth)) / Math.max(1, height_px);
}

type ViewPoint = readonly [x: number, y: number];

/** The part of the line between two points that is in the view, as in ray_through(); undefined: none is. */
export function visible_part(
  from: Vec3,
  to: Vec3,
  eye: Eye,
  aspect: number,
): readonly [ViewPoint, ViewPoint] | undefined {
  const ahead = rotate(eye.orientation, forward);
  const [a, b] = [from, to].map((point) => dot(sub(point, eye.position), ahead)) as [
    number,
    number,
  ];
  const nearest = nearest_share * Math.max(a, b);
  if (!(nearest > 0)) return undefined;
  const cut = (point: Vec3, other: Vec3, depth: number): Vec3 =>
    depth >= nearest
      ? point
      : add(point, scale(sub(other, point), (nearest - depth) / Math.abs(b - a)));
  const [start, end] = [
    project(cut(from, to, a), eye, aspect),
    project(cut(to, from, b), eye, aspect),
  ];
  if (!start || !end) return undefined;
  // Liang and Barsky: the part that is on the inner side of all four edges.
  let [first, last] = [0, 1];
  for (const axis of [0, 1] as const) {
    const way = end[axis] - start[axis];
    for (const [towards, room] of [
      [-way, start[axis]],
      [way, 1 - start[axis]],
    ] as const) {
      if (towards < 0) first = Math.max(first, room / towards);
      else if (towards > 0) last = Math.min(last, room / towards);
      else if (room < 0) return undefined;
    }
  }
  if (first > last) return undefined;
  const at = (share: number): ViewPoint => [
    start[0] + share * (end[0] - start[0]),
    start[1] + share * (end[1] - start[1]),
  ];
  return [at(first), at(last)];
}
const nearest_share = 1e-3; // of the depth of the line: what is behind the eye has no place in the view

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

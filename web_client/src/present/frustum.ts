// What each eye of a headset sees, and warps between such views. Pure.
import { clamp, multiply, conjugate, rotate, type Quat, type Vec3 } from '../base/vector';
import { half_height, type Eye, type Pose } from '../camera/eye';
import { warp_matrix, type Matrix3, type Sides } from './warp';

/** Tangents of the angles from the view axis to the sides of a view: x right, y down. */
export interface Frustum {
  readonly left: number;
  readonly right: number;
  readonly up: number;
  readonly down: number;
}

/** A view whose axis need not be in its middle. */
export interface FrustumView extends Pose {
  readonly frustum: Frustum;
}

const most_tangent = 10; // of the wire (proto/types.proto)
const least_cosine = 0.05; // of a corner to the axis: beyond that, its tangent is as large as can be
const unit_fov_rad = Math.PI / 2; // whose image plane at depth 1 reaches from -1 to 1

/** Of a projection matrix of WebXR: column-major, as glFrustum makes it. */
export const frustum_of = (m: ArrayLike<number>): Frustum => ({
  left: (m[8]! - 1) / m[0]!,
  right: (m[8]! + 1) / m[0]!,
  up: -(m[9]! + 1) / m[5]!,
  down: (1 - m[9]!) / m[5]!,
});

/** Of a camera whose axis is in the middle of its view. */
export function frustum_of_eye(eye: Eye, aspect: number): Frustum {
  const half = half_height(eye);
  return { left: -half * aspect, right: half * aspect, up: -half, down: half };
}

/**
 * The smallest frustum along the axes of `head` that contains the one along the axes of `eye`: the server draws
 * both eyes along one axis, and those of some headsets are turned outwards.
 */
export function along_axes_of(head: Quat, eye: Quat, frustum: Frustum): Frustum {
  const turn = multiply(conjugate(head), eye);
  const { left, right, up, down } = frustum;
  const corners = [
    [left, up],
    [right, up],
    [left, down],
    [right, down],
  ].map(([x, y]) => {
    const [a, b, c] = rotate(turn, [x!, y!, 1]);
    const depth = Math.max(c, least_cosine * Math.hypot(a, b, c));
    return [a / depth, b / depth] as const;
  });
  const side = (of: (...all: number[]) => number, axis: 0 | 1): number =>
    clamp(of(...corners.map((corner) => corner[axis])), -most_tangent, most_tangent);
  return {
    left: side(Math.min, 0),
    right: side(Math.max, 0),
    up: side(Math.min, 1),
    down: side(Math.max, 1),
  };
}

const half_width = ({ left, right }: Frustum): number => (right - left) / 2;
const half_depth = ({ up, down }: Frustum): number => (down - up) / 2;

/** Width over height of its image plane. */
export const aspect_of = (frustum: Frustum): number => half_width(frustum) / half_depth(frustum);

/** With sides so many times as long, about the same middle. */
export function widened_frustum(frustum: Frustum, { x, y }: Sides): Frustum {
  const { left, right, up, down } = frustum;
  const [middle, level] = [(left + right) / 2, (up + down) / 2];
  const [across, along] = [half_width(frustum) * x, half_depth(frustum) * y];
  const within = (tangent: number): number => clamp(tangent, -most_tangent, most_tangent);
  return {
    left: within(middle - across),
    right: within(middle + across),
    up: within(level - along),
    down: within(level + along),
  };
}

/** How many times as long the sides of `wide` are. */
export const sides_over = (wide: Frustum, frustum: Frustum): Sides => ({
  x: half_width(wide) / half_width(frustum),
  y: half_depth(wide) / half_depth(frustum),
});

/**
 * As warp_matrix() does: from points of the view to points of the picture, where -1…1 spans the frustum of
 * each, exact for the plane at `distance` ahead of the view.
 */
export function frustum_warp(picture: FrustumView, view: FrustumView, distance: number): Matrix3 {
  const m = warp_matrix(
    { ...picture, fov_y_rad: unit_fov_rad },
    { ...view, fov_y_rad: unit_fov_rad },
    1,
    distance,
  );
  const { frustum: seen } = view;
  const { frustum: shown } = picture;
  const column = (x: number, y: number, z: number): Vec3 => {
    const [a, b, c] = [0, 1, 2].map((i) => m[i]! * x + m[3 + i]! * y + m[6 + i]! * z) as [
      number,
      number,
      number,
    ];
    return [
      (a - c * ((shown.left + shown.right) / 2)) / half_width(shown),
      (b - c * ((shown.up + shown.down) / 2)) / half_depth(shown),
      c,
    ];
  };
  return new Float32Array([
    ...column(half_width(seen), 0, 0),
    ...column(0, half_depth(seen), 0),
    ...column((seen.left + seen.right) / 2, (seen.up + seen.down) / 2, 1),
  ]);
}

// Warps a picture to a camera that has moved since the picture was rendered. tests/load/warp.cpp repeats
// it for benchmarks. Pure.
import { angle_between, conjugate, multiply, rotate, scale, sub, type Vec3 } from '../base/vector';
import { half_height, same_projection, type Eye } from '../camera/eye';

/** Column-major, for homogeneous coordinates (x, y, 1); x and y are -1…1 across an image, y down. */
export type Matrix3 = Float32Array;

/**
 * Homography from points of the view to points of the picture. It is exact for the plane at `distance`
 * ahead of the view, at a right angle to its axis. With Infinity it is exact for the far field, where
 * only rotation counts. Between orthographic views of one direction it is exact for all. `aspect`: width
 * over height of the picture, and of the view where that differs.
 */
export function warp_matrix(
  picture: Eye,
  view: Eye,
  aspect: number,
  distance: number,
  view_aspect = aspect,
): Matrix3 {
  const to_picture = conjugate(picture.orientation);
  const turn = multiply(to_picture, view.orientation);
  const is_parallel = view.view_height !== undefined;
  const way = rotate(to_picture, sub(view.position, picture.position));
  const shift = scale(way, is_parallel ? 1 : 1 / distance);
  const [from_half, to_half] = [half_height(view), half_height(picture)];
  const column = (axis: Vec3, length: number, add: Vec3): number[] => {
    const [x, y, z] = rotate(turn, axis);
    return [
      ((x * length + add[0]) / to_half) * (1 / aspect),
      (y * length + add[1]) / to_half,
      is_parallel ? axis[2] : z * length + add[2],
    ];
  };
  const none: Vec3 = [0, 0, 0];
  return new Float32Array([
    ...column([1, 0, 0], from_half * view_aspect, none),
    ...column([0, 1, 0], from_half, none),
    ...column([0, 0, 1], is_parallel ? 0 : 1, shift),
  ]);
}

const same_direction_rad = 1e-3;

/** Whether a warp shows the view: orthographic pictures show one direction only. */
export const can_show = (picture: Eye, view: Eye): boolean =>
  same_projection(picture, view) &&
  (view.view_height === undefined ||
    angle_between(picture.orientation, view.orientation) < same_direction_rad);

/** Point of the picture of a point of the view; undefined behind the picture's camera. */
export function warped(m: Matrix3, x: number, y: number): readonly [number, number] | undefined {
  const w = m[2]! * x + m[5]! * y + m[8]!;
  if (w <= 1e-6) return undefined;
  return [(m[0]! * x + m[3]! * y + m[6]!) / w, (m[1]! * x + m[4]! * y + m[7]!) / w];
}

const probes = [-1, -0.5, 0, 0.5, 1];
const farthest = 4;

/** Sides of a picture over those of the view. They are larger where a turn needs what is beside the view. */
export interface Sides {
  readonly x: number;
  readonly y: number;
}

/** How far the view reaches from the middle of the picture: 1 is the border, and 4 the most returned. */
export function reach(m: Matrix3): Sides {
  let [x_most, y_most] = [0, 0];
  for (const [x, y] of probes.flatMap(
    (v) =>
      [
        [v, -1],
        [v, 1],
        [-1, v],
        [1, v],
      ] as const,
  )) {
    const at = warped(m, x, y);
    x_most = Math.max(x_most, at ? Math.abs(at[0]) : farthest);
    y_most = Math.max(y_most, at ? Math.abs(at[1]) : farthest);
  }
  return { x: Math.min(x_most, farthest), y: Math.min(y_most, farthest) };
}

/** Share of the view that the picture does not cover, sampled on a grid. */
export function uncovered_share(m: Matrix3, columns = 64, rows = 36): number {
  let uncovered = 0;
  for (let row = 0; row < rows; ++row) {
    for (let column = 0; column < columns; ++column) {
      const at = warped(m, (2 * column + 1) / columns - 1, (2 * row + 1) / rows - 1);
      if (!at || Math.abs(at[0]) > 1 || Math.abs(at[1]) > 1) uncovered += 1;
    }
  }
  return uncovered / (columns * rows);
}

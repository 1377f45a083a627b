// Vectors and quaternions as plain tuples. Camera axes: x right, y down, z forward (right-handed).
// Quaternions are (x, y, z, w), unit, and turn camera axes into the world.

export type Vec3 = readonly [x: number, y: number, z: number];
export type Quat = readonly [x: number, y: number, z: number, w: number];

export const right: Vec3 = [1, 0, 0];
export const forward: Vec3 = [0, 0, 1];
export const identity: Quat = [0, 0, 0, 1];

export const add = (a: Vec3, b: Vec3): Vec3 => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
export const sub = (a: Vec3, b: Vec3): Vec3 => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
export const scale = (a: Vec3, s: number): Vec3 => [a[0] * s, a[1] * s, a[2] * s];
export const dot = (a: Vec3, b: Vec3): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const length = (a: Vec3): number => Math.hypot(a[0], a[1], a[2]);

export const cross = (a: Vec3, b: Vec3): Vec3 => [
  a[1] * b[2] - a[2] * b[1],
  a[2] * b[0] - a[0] * b[2],
  a[0] * b[1] - a[1] * b[0],
];

/** `fallback` where `a` has no direction. */
export function normalize(a: Vec3, fallback: Vec3): Vec3 {
  const n = length(a);
  return n > 1e-12 && Number.isFinite(n) ? scale(a, 1 / n) : fallback;
}

/** a after b: rotate(multiply(a, b), v) = rotate(a, rotate(b, v)). Renormalised. */
export function multiply(a: Quat, b: Quat): Quat {
  return unit([
    a[3] * b[0] + a[0] * b[3] + a[1] * b[2] - a[2] * b[1],
    a[3] * b[1] - a[0] * b[2] + a[1] * b[3] + a[2] * b[0],
    a[3] * b[2] + a[0] * b[1] - a[1] * b[0] + a[2] * b[3],
    a[3] * b[3] - a[0] * b[0] - a[1] * b[1] - a[2] * b[2],
  ]);
}

/** The identity where `q` has no direction. */
export function unit(q: Quat): Quat {
  const n = Math.hypot(q[0], q[1], q[2], q[3]);
  return n > 1e-12 && Number.isFinite(n) ? [q[0] / n, q[1] / n, q[2] / n, q[3] / n] : identity;
}

/** Right-handed turn by `angle_rad` about the unit vector `axis`. */
export function axis_angle(axis: Vec3, angle_rad: number): Quat {
  const s = Math.sin(angle_rad / 2);
  return [axis[0] * s, axis[1] * s, axis[2] * s, Math.cos(angle_rad / 2)];
}

export function rotate(q: Quat, v: Vec3): Vec3 {
  const u: Vec3 = [q[0], q[1], q[2]];
  const t = scale(cross(u, v), 2);
  return add(add(v, scale(t, q[3])), cross(u, t));
}

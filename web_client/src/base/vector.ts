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

/** A coordinate with so many digits, or with four decimals where that is more: scenes may be far from 0. */
export const short_coordinate = (v: number, digits: number): number =>
  Number(Math.abs(v) < 1000 ? v.toPrecision(digits) : v.toFixed(4));

export const clamp = (value: number, low: number, high: number): number =>
  Math.min(high, Math.max(low, value));

export const same = (a: Vec3, b: Vec3): boolean => a.every((v, i) => v === b[i]);

/** Returns `fallback` where `a` has no direction. */
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

/** Normalises. Returns the identity where `q` has no direction. */
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

export const conjugate = (q: Quat): Quat => [-q[0], -q[1], -q[2], q[3]];

/** Angle of the rotation between two orientations, rad. */
export function angle_between(a: Quat, b: Quat): number {
  const cosine = Math.abs(a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]);
  return 2 * Math.acos(Math.min(1, cosine));
}

/** Interpolates from `a` (share 0) to `b` (share 1) at constant angular rate, the short way round. */
export function slerp(a: Quat, b: Quat, share: number): Quat {
  const cosine = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3];
  const sign = cosine < 0 ? -1 : 1;
  const angle = Math.acos(Math.min(1, Math.abs(cosine)));
  const near = angle < 1e-4;
  const from = near ? 1 - share : Math.sin((1 - share) * angle) / Math.sin(angle);
  const to = sign * (near ? share : Math.sin(share * angle) / Math.sin(angle));
  return unit([
    from * a[0] + to * b[0],
    from * a[1] + to * b[1],
    from * a[2] + to * b[2],
    from * a[3] + to * b[3],
  ]);
}

/** The rotation whose axes are these orthonormal vectors. */
export function from_axes(x: Vec3, y: Vec3, z: Vec3): Quat {
  const trace = x[0] + y[1] + z[2];
  if (trace > 0) {
    return unit([y[2] - z[1], z[0] - x[2], x[1] - y[0], trace + 1]);
  }
  if (x[0] >= y[1] && x[0] >= z[2]) {
    return unit([1 + x[0] - y[1] - z[2], x[1] + y[0], z[0] + x[2], y[2] - z[1]]);
  }
  if (y[1] >= z[2]) {
    return unit([x[1] + y[0], 1 + y[1] - x[0] - z[2], y[2] + z[1], z[0] - x[2]]);
  }
  return unit([z[0] + x[2], y[2] + z[1], 1 + z[2] - x[0] - y[1], x[1] - y[0]]);
}

/** Orientation of a camera at `from` that looks at `to`, with `up` upright in its picture. */
export function look_at(from: Vec3, to: Vec3, up: Vec3): Quat {
  const view = normalize(sub(to, from), forward);
  const aside = Math.abs(view[0]) < 0.7 ? right : forward;
  const x = normalize(cross(view, up), normalize(cross(view, aside), right));
  return from_axes(x, cross(view, x), view);
}

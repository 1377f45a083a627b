// A small scene with near and far things that tests draw themselves, with their depths.
import { deflateRawSync } from 'node:zlib';
import { add, rotate, scale, type Vec3 } from '#client/base/vector';
import type { Eye } from '#client/camera/eye';
import type { DepthFields } from '#client/present/depth_mesh';
import { frustum_of_eye, type FrustumView } from '#client/present/frustum';
import type { Picture } from './pictures';

interface Box {
  readonly low: Vec3;
  readonly high: Vec3;
}

/** Ground and a wall at the end of a street, a kiosk, and a post before it. Units are metres, y points down. */
const boxes: readonly Box[] = [
  { low: [-40, 1.6, -10], high: [40, 2, 30] },
  { low: [-40, -12, 14], high: [40, 2, 15] },
  { low: [-1.7, -0.6, 4], high: [-0.4, 1.6, 5.5] },
  { low: [0.9, -2, 2.6], high: [1.4, 1.6, 3.1] },
];

/** The distance along a ray to a box, in lengths of the ray. */
function distance_to({ low, high }: Box, origin: Vec3, ray: Vec3): number {
  let [near, far] = [1e-3, Infinity];
  for (let i = 0; i < 3; ++i) {
    const [a, b] = [(low[i]! - origin[i]!) / ray[i]!, (high[i]! - origin[i]!) / ray[i]!];
    near = Math.max(near, Math.min(a, b));
    far = Math.min(far, Math.max(a, b));
  }
  return near <= far ? near : Infinity;
}

/** Grey of a point: smooth noise with cells of 0.12 and 0.5 m. */
function grey(point: Vec3): number {
  const corner = (x: number, y: number, z: number): number => {
    const s = Math.sin(x * 127.1 + y * 311.7 + z * 74.7) * 43758.5453;
    return s - Math.floor(s);
  };
  const noise = (side: number): number => {
    const [x, y, z] = scale(point, 1 / side);
    const [i, j, k] = [Math.floor(x), Math.floor(y), Math.floor(z)];
    let sum = 0;
    for (let at = 0; at < 8; ++at) {
      const [a, b, c] = [at & 1, (at >> 1) & 1, at >> 2];
      const share = (v: number, on: number): number => (on ? v : 1 - v);
      sum += share(x - i, a) * share(y - j, b) * share(z - k, c) * corner(i + a, j + b, k + c);
    }
    return sum;
  };
  return 40 + 120 * noise(0.5) + 80 * noise(0.12);
}

/** View depth and grey along a ray of the view; x and y are -1…1 across it. Infinite: sky. */
function seen(view: FrustumView, x: number, y: number): { depth: number; grey: number } {
  const { left, right, up, down } = view.frustum;
  const across = left + ((right - left) * (x + 1)) / 2;
  const ray = rotate(view.orientation, [across, up + ((down - up) * (y + 1)) / 2, 1]);
  const depth = Math.min(...boxes.map((box) => distance_to(box, view.position, ray)));
  return { depth, grey: depth < Infinity ? grey(add(view.position, scale(ray, depth))) : 230 };
}

const centred = (eye: Eye, aspect: number): FrustumView => ({
  ...eye,
  frustum: frustum_of_eye(eye, aspect),
});

export const street_picture = (eye: Eye, width: number, height: number): Picture =>
  street_view([centred(eye, width / height)], width, height);

/** Views of the same size, side by side in a picture. */
export function street_view(views: readonly FrustumView[], width: number, height: number): Picture {
  const rgba = new Uint8ClampedArray(4 * width * height);
  for (let i = 0; i < width * height; ++i) {
    const [column, row] = [i % width, Math.floor(i / width)];
    const [view, x] = place_in(views, (column + 0.5) / width);
    const value = seen(view, x, (2 * row + 1) / height - 1).grey;
    rgba.set([value, value, value, 255], 4 * i);
  }
  return { width, height, rgba };
}

/** The view at this share of the width of a picture, and where in it, -1…1. */
function place_in(
  views: readonly FrustumView[],
  share: number,
): readonly [view: FrustumView, x: number] {
  const at = share * views.length;
  return [views[Math.floor(at)]!, 2 * (at - Math.floor(at)) - 1];
}

export const street_depths = (
  eye: Eye,
  aspect: number,
  columns: number,
  rows: number,
): DepthFields => street_view_depths([centred(eye, aspect)], columns, rows);

/** The depth grid of such a picture, as a frame carries it. A cell has the depth of its middle. */
export function street_view_depths(
  views: readonly FrustumView[],
  columns: number,
  rows: number,
): DepthFields {
  const inverse = Array.from({ length: columns * rows }, (_, i) => {
    const [view, x] = place_in(views, ((i % columns) + 0.5) / columns);
    return 1 / seen(view, x, (2 * Math.floor(i / columns) + 1) / rows - 1).depth;
  });
  const depthScale = Math.max(...inverse) / 255 ** 2;
  const codes = inverse.map((value) => Math.round(Math.sqrt(value / depthScale)));
  const rests = codes.map((code, i) => {
    const [left, above, corner] = [codes[i - 1]!, codes[i - columns]!, codes[i - columns - 1]!];
    if (i === 0) return code;
    if (i < columns) return code - left;
    if (i % columns === 0) return code - above;
    const [low, high] = [Math.min(left, above), Math.max(left, above)];
    return code - Math.max(low, Math.min(high, left + above - corner));
  });
  const depthCodes = new Uint8Array(deflateRawSync(Uint8Array.from(rests)));
  return { depthColumns: columns, depthRows: rows, depthScale, depthCodes };
}

// Plates in the room, and what rays meet of them. Pure.
import {
  add,
  cross,
  dot,
  length,
  normalize,
  right,
  rotate,
  scale,
  sub,
  type Quat,
  type Vec3,
} from '../base/vector';
import type { Plate } from './overlay';

/** What somebody points along, in the room. */
export interface RoomRay {
  readonly origin: Vec3;
  /** Unit. */
  readonly direction: Vec3;
}

/** Where a ray meets a plate: shares of its width and height, y down, and how far away. */
export function met_plate(
  { origin, direction }: RoomRay,
  plate: Plate,
): { readonly x: number; readonly y: number; readonly distance: number } | undefined {
  const normal = cross(plate.right, plate.down);
  const towards = dot(direction, normal);
  if (Math.abs(towards) < 1e-9) return undefined;
  const distance = dot(sub(plate.middle, origin), normal) / towards;
  if (!(distance > 0)) return undefined;
  const at = sub(add(origin, scale(direction, distance)), plate.middle);
  const x = 0.5 + dot(at, plate.right) / dot(plate.right, plate.right) / 2;
  const y = 0.5 + dot(at, plate.down) / dot(plate.down, plate.down) / 2;
  return x >= 0 && x <= 1 && y >= 0 && y <= 1 ? { x, y, distance } : undefined;
}

const down: Vec3 = [0, 1, 0];

/** An upright plate that faces `eye`; tilted, too, where that is above or below it. */
export function facing(middle: Vec3, eye: Vec3, half_width: number, half_height: number): Plate {
  const ahead = normalize(sub(middle, eye), [0, 0, 1]);
  const across = normalize(cross(down, ahead), right);
  return {
    middle,
    right: scale(across, half_width),
    down: scale(cross(ahead, across), half_height),
  };
}

/** Level direction of a view in the room. */
export function level_ahead(orientation: Quat): Vec3 {
  const [x, , z] = rotate(orientation, [0, 0, 1]);
  const level: Vec3 = [x, 0, z];
  return length(level) > 1e-3 ? normalize(level, [0, 0, 1]) : rotate(orientation, [0, -1, 0]);
}

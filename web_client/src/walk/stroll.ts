// A walk along a path as a movement that is known in advance. Pure.
import { add, length, look_at, scale, slerp, sub, type Vec3, clamp } from '../base/vector';
import type { Eye } from '../camera/eye';
import type { Flight } from '../camera/flight';
import { cells_per_eye_height, eyes_of, type Stand, type WalkMap } from './walk_map';
import { floor_height } from './walker';

const usual_cells_per_s = 1.25 * cells_per_eye_height;
const longest_s = 10; // longer ways are gone faster
const apart_cells = 0.5; // places of a path
const smoothed_positions = 6; // to each side: stairs become slopes, and corners round
const ahead_cells = 1.2 * cells_per_eye_height; // as far as a walker looks along the way
const speeds_up_s = 0.5;
const turns_in_s = 1.2;

/** Places along a path, so dense that no stair lies between two. */
function dense(map: WalkMap, path: readonly Stand[]): Stand[] {
  const positions: Stand[] = path.slice(0, 1);
  for (const to of path.slice(1)) {
    const from = positions[positions.length - 1]!;
    const [x, y] = [to.east - from.east, to.north - from.north];
    const pieces = Math.max(1, Math.ceil(Math.hypot(x, y) / apart_cells));
    for (let k = 1; k <= pieces; ++k) {
      const [east, north] = [from.east + (x * k) / pieces, from.north + (y * k) / pieces];
      const { height } = positions[positions.length - 1]!;
      positions.push({ east, north, height: floor_height(map, east, north, height) ?? height });
    }
  }
  return positions;
}

/** Means over neighbours. The window shrinks towards the ends, which stay. */
const smoothed = (positions: readonly Vec3[]): Vec3[] =>
  positions.map((_, i) => {
    const side = Math.min(smoothed_positions, i, positions.length - 1 - i);
    const near = positions.slice(i - side, i + side + 1);
    return scale(near.reduce(add), 1 / near.length);
  });

/** The walk of eyes that are at `from` along a path; at its end they look where they went. */
export function stroll(map: WalkMap, path: readonly Stand[], from: Eye): Flight {
  const up = map.axes[2];
  const eyes = smoothed(smoothed(dense(map, path).map((stand) => eyes_of(map, stand))));
  const along = [0]; // length of the way to each place, world units
  eyes.slice(1).forEach((point, k) => along.push(along[k]! + length(sub(point, eyes[k]!))));
  const way = along[along.length - 1]!;
  const speed = Math.max(usual_cells_per_s * map.cell, way / longest_s);
  const ramp_s = Math.min(speeds_up_s, way / speed);
  const duration_s = way / speed + ramp_s;
  const point_at = (gone: number): Vec3 => {
    let [low, high] = [0, along.length - 1];
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (along[middle]! <= gone) low = middle;
      else high = middle;
    }
    const piece = along[high]! - along[low]!;
    const share = piece > 0 ? clamp((gone - along[low]!) / piece, 0, 1) : 1;
    return add(eyes[low]!, scale(sub(eyes[high]!, eyes[low]!), share));
  };
  /** Even speed, which grows and shrinks evenly at the ends. */
  const gone_at = (time_s: number): number => {
    const rest_s = duration_s - time_s;
    if (time_s < ramp_s) return (speed * time_s * time_s) / (2 * ramp_s);
    if (rest_s < ramp_s) return way - (speed * rest_s * rest_s) / (2 * ramp_s);
    return speed * (time_s - ramp_s / 2);
  };
  const away = sub(from.position, eyes[0]!);
  const ahead = ahead_cells * map.cell;
  return {
    duration_s,
    at: (time_s) => {
      const gone = duration_s > 0 ? gone_at(clamp(time_s, 0, duration_s)) : way;
      const here = point_at(gone);
      // Towards the end, the direction stays that of the last stretch.
      const back = Math.max(0, Math.min(gone, way - ahead));
      const line = sub(point_at(Math.min(way, gone + ahead)), point_at(back));
      const flat = sub(line, scale(up, line[0] * up[0] + line[1] * up[1] + line[2] * up[2]));
      const turned = duration_s > 0 ? Math.min(1, time_s / Math.min(turns_in_s, duration_s)) : 1;
      const share = turned * turned * (3 - 2 * turned);
      const level =
        length(flat) > 1e-6 * ahead ? look_at(here, add(here, flat), up) : from.orientation;
      return {
        position: add(here, scale(away, 1 - share)),
        orientation: slerp(from.orientation, level, share),
        fov_y_rad: from.fov_y_rad,
      };
    },
  };
}

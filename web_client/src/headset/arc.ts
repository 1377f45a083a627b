// Where a visitor of a headset teleports to: the end of an arc over the walkable area. Pure.
import { add, length, scale, sub, type Vec3 } from '../base/vector';
import { met_in } from '../walk/floor';
import { clear_near } from '../walk/map_walker';
import { to_grid, type Stand, type WalkMap } from '../walk/walk_map';

const speed_m_s = 8; // reaches 6.5 m from a level hand at 1.2 m, and 11 m from one that is raised
const gravity_m_s2 = 9.81;
const step_s = 1 / 30;
const longest_s = 3;
const piece_cells = 0.5;
const most_pieces = 4096;

/** Points of the way of something that is thrown along a unit direction. `down`: unit. Metres. */
export function thrown(origin: Vec3, direction: Vec3, down: Vec3): Vec3[] {
  const points: Vec3[] = [];
  for (let t = 0; t <= longest_s; t += step_s) {
    const fallen = scale(down, (gravity_m_s2 / 2) * t * t);
    points.push(add(origin, add(scale(direction, speed_m_s * t), fallen)));
  }
  return points;
}

interface Landing {
  /** Undefined: what it meets is no floor, or it meets nothing. */
  readonly stand: Stand | undefined;
  /** How many of the points are before it. */
  readonly points: number;
}

/** What the way along these points of the world meets first. */
export function landing(map: WalkMap, points: readonly Vec3[]): Landing {
  const cells = points.map((point) => to_grid(map, point));
  let left = most_pieces;
  for (let i = 1; i < cells.length; ++i) {
    const [from, to] = [cells[i - 1]!, cells[i]!];
    const way = sub(to, from);
    const pieces = Math.max(1, Math.ceil(length(way) / piece_cells));
    for (let k = 0; k < pieces; ++k) {
      if (--left < 0) return { stand: undefined, points: i };
      const [, , a] = add(from, scale(way, k / pieces));
      const [x, y, b] = add(from, scale(way, (k + 1) / pieces));
      const met = met_in(map, Math.floor(x), Math.floor(y), Math.min(a, b), Math.max(a, b));
      if (met === undefined) continue;
      // An arc that rises to a floor meets the ceiling below it.
      const stand =
        met === 'blocked' || b > a
          ? undefined
          : clear_near(map, { east: x, north: y, height: met });
      return { stand, points: i };
    }
  }
  return { stand: undefined, points: points.length };
}

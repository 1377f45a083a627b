// The floor that a ray meets, by the map alone: no question to the server.
import { dot, clamp } from '../base/vector';
import type { Ray } from '../camera/ray';
import { clear_near } from './map_walker';
import { height_of, Kind, kind_of } from './tiles';
import { positions_at, to_grid, type Stand, type WalkMap } from './walk_map';

const farthest_cells = 1200;
const before_wall_cells = 24; // as far as a place before a wall is looked for
const wall_cells = 40; // of height: a wall is taken to reach over a visitor's head
const furniture_cells = 8;

/** What a ray meets between two heights of a column: its ground, or something in the way. */
export function met_in(
  map: WalkMap,
  column: number,
  row: number,
  low: number,
  high: number,
): number | 'blocked' | undefined {
  const positions = positions_at(map, column, row);
  for (let i = positions.length - 1; i >= 0; --i) {
    const height = height_of(positions[i]!);
    const kind = kind_of(positions[i]!);
    if (kind === Kind.clear || kind === Kind.near) {
      if (low <= height && high >= height - map.step) return height;
    } else if (
      low <= height + (kind === Kind.obstacle ? wall_cells : furniture_cells) &&
      high >= height
    ) {
      return 'blocked';
    }
  }
  return undefined;
}

/**
 * Where a visitor comes to stand who points along the ray: on the floor that it meets, or before the wall that it
 * meets first; undefined where it meets neither.
 */
export function floor_along(map: WalkMap, ray: Ray): Stand | undefined {
  const [x0, y0, z0] = to_grid(map, ray.origin);
  const [dx, dy, dz] = map.axes.map((axis) => dot(ray.direction, axis)) as [number, number, number];
  const flat = Math.hypot(dx, dy);
  let last: Stand | undefined; // clear ground below the ray
  let [column, row] = [Math.floor(x0), Math.floor(y0)];
  // From column to column (Amanatides and Woo 1987). Lengths are those along the ray, in cells.
  const to_border = (at: number, direction: number): number =>
    direction === 0
      ? Infinity
      : ((direction > 0 ? Math.floor(at) + 1 : Math.floor(at)) - at) / direction;
  let [next_x, next_y] = [to_border(x0, dx), to_border(y0, dy)];
  for (let from = 0; from * flat <= farthest_cells; ) {
    const to = Math.min(next_x, next_y, from + farthest_cells);
    const [a, b] = [z0 + dz * from, z0 + dz * to];
    const met = met_in(map, column, row, Math.min(a, b), Math.max(a, b));
    if (met === 'blocked') {
      const near =
        last && Math.hypot(last.east - column - 0.5, last.north - row - 0.5) <= before_wall_cells;
      return near ? last : undefined;
    }
    if (met !== undefined) {
      const along = dz === 0 ? from : clamp((met - z0) / dz, from, to);
      return clear_near(map, { east: x0 + dx * along, north: y0 + dy * along, height: met });
    }
    const below = clear_below(map, column, row, Math.min(a, b));
    if (below !== undefined) last = { east: column + 0.5, north: row + 0.5, height: below };
    if (!(to < from + farthest_cells)) return undefined;
    from = to;
    if (next_x <= next_y) {
      column += Math.sign(dx);
      next_x += 1 / Math.abs(dx);
    } else {
      row += Math.sign(dy);
      next_y += 1 / Math.abs(dy);
    }
  }
  return undefined;
}

function clear_below(
  map: WalkMap,
  column: number,
  row: number,
  height: number,
): number | undefined {
  const position = positions_at(map, column, row).findLast((at) => height_of(at) <= height);
  return position !== undefined && kind_of(position) === Kind.clear
    ? height_of(position)
    : undefined;
}

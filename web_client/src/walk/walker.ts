// A body that walks on a WalkMap: the same steps as render_core/walk/walker.h, which is its oracle.
import type { Vec3 } from '../base/vector';
import { height_of, Kind, kind_of } from './tiles';
import { clear_at, positions_at, to_grid, type Stand, type WalkMap } from './walk_map';

const piece = 0.4; // cells; a body moves by at most this much at a time
const most_pieces = 25_000;
const aside = [0, 1, -1, 2, -2, 3, -3].map((k) => (k * Math.PI) / 8);

/** Height of the floor at a point, bilinear between the middles of cells; undefined off clear ground. */
export function floor_height(
  map: WalkMap,
  east: number,
  north: number,
  height: number,
): number | undefined {
  const here = clear_at(map, Math.floor(east), Math.floor(north), height);
  if (here < 0) return undefined;
  const own = height_of(here);
  const column = Math.floor(east - 0.5);
  const row = Math.floor(north - 0.5);
  const at = (x: number, y: number): number => {
    const found = clear_at(map, column + x, row + y, own);
    return found < 0 ? own : height_of(found);
  };
  const mix = (a: number, b: number, share: number): number => a + (b - a) * share;
  const x = east - 0.5 - column;
  return mix(mix(at(0, 0), at(1, 0), x), mix(at(0, 1), at(1, 1), x), north - 0.5 - row);
}

function try_piece(map: WalkMap, from: Stand, x: number, y: number): Stand | undefined {
  const east = from.east + x;
  const north = from.north + y;
  const here = [Math.floor(from.east), Math.floor(from.north)] as const;
  const there = [Math.floor(east), Math.floor(north)] as const;
  let ground = clear_at(map, ...here, from.height);
  if (ground < 0) return undefined;
  if (here[0] !== there[0] && here[1] !== there[1]) {
    // Two cells that touch in a corner alone: the body passes through one of those beside them.
    const height = height_of(ground);
    ground = clear_at(map, there[0], here[1], height);
    if (ground < 0) ground = clear_at(map, here[0], there[1], height);
    if (ground < 0) return undefined;
  }
  const height = floor_height(map, east, north, height_of(ground));
  return height === undefined ? undefined : { east, north, height };
}

/** The clear ground below a point of the world, where a visitor would come to stand. */
export function stand_below(map: WalkMap, point: Vec3): Stand | undefined {
  const [east, north, height] = to_grid(map, point);
  const below = positions_at(map, Math.floor(east), Math.floor(north)).findLast(
    (at) => kind_of(at) === Kind.clear && height_of(at) <= height + map.step,
  );
  return below === undefined ? undefined : { east, north, height: height_of(below) };
}

/** Where a walker comes that wants to move by (x, y) cells to the east and north; it slides along walls. */
export function move(map: WalkMap, from: Stand, x: number, y: number): Stand {
  const pieces = Math.min(Math.ceil(Math.hypot(x, y) / piece), most_pieces);
  let at = from;
  for (let k = 0; k < pieces; ++k) {
    let next: Stand | undefined;
    for (const angle of aside) {
      const c = Math.cos(angle);
      const s = Math.sin(angle);
      next = try_piece(map, at, (c * (c * x - s * y)) / pieces, (c * (s * x + c * y)) / pieces);
      if (next) break;
    }
    if (!next) break;
    at = next;
  }
  return at;
}

/** Whether a walker gets from `from` to `to` on the straight line. */
export function straight(map: WalkMap, from: Stand, to: Stand): boolean {
  const [x, y] = [to.east - from.east, to.north - from.north];
  const pieces = Math.ceil(Math.hypot(x, y) / piece);
  let at = from;
  for (let k = 0; k < pieces; ++k) {
    const next = try_piece(map, at, x / pieces, y / pieces);
    if (!next) return false;
    at = next;
  }
  return Math.abs(at.height - to.height) <= map.step;
}

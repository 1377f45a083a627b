// A visitor who walks on a WalkMap.
import { dot, scale, add, sub, type Vec3 } from '../base/vector';
import type { Walker } from '../camera/walker';
import { height_of } from './tiles';
import { cells_per_eye_height, clear_at, eyes_of, type Stand, type WalkMap } from './walk_map';
import { move, stand_below } from './walker';

const nearby_cells = 96;

/** The clear ground nearest to a column, below `point`; undefined where none is near. World units. */
function stand_around(map: WalkMap, point: Vec3, farthest_cells: number): Stand | undefined {
  const here = stand_below(map, point);
  if (here) return here;
  const [east, north] = map.axes;
  for (let r = 1; r <= farthest_cells; ++r) {
    let best: Stand | undefined;
    let nearest = Infinity;
    for (let k = -r; k < r; ++k)
      for (const [x, y] of [
        [k, -r],
        [r, k],
        [-k, r],
        [-r, -k],
      ] as const) {
        const distance = Math.hypot(x, y);
        if (distance >= nearest) continue;
        const beside = add(point, add(scale(east, x * map.cell), scale(north, y * map.cell)));
        const stand = stand_below(map, beside);
        if (stand) [best, nearest] = [stand, distance];
      }
    if (best) return best;
  }
  return undefined;
}

/** The clear ground nearest to ground that has no room for a body, or to itself; undefined where none is near. */
export function clear_near(map: WalkMap, stand: Stand, most_cells = 8): Stand | undefined {
  const [column, row] = [Math.floor(stand.east), Math.floor(stand.north)];
  let best: Stand | undefined;
  let nearest = Infinity;
  for (let y = -most_cells; y <= most_cells; ++y)
    for (let x = -most_cells; x <= most_cells; ++x) {
      const distance = Math.hypot(x, y);
      if (distance >= nearest) continue;
      const position = clear_at(map, column + x, row + y, stand.height);
      if (position < 0) continue;
      nearest = distance;
      const height = height_of(position);
      best =
        distance === 0
          ? { ...stand, height }
          : { east: column + x + 0.5, north: row + y + 0.5, height };
    }
  return best;
}

export class MapWalker implements Walker {
  readonly eye_height: number;
  /** The highest step up or down, world units. */
  readonly step: number;
  private stand_: Stand;

  constructor(readonly map: WalkMap) {
    this.eye_height = cells_per_eye_height * map.cell;
    this.step = map.step * map.cell;
    this.stand_ = map.start;
  }

  stand_near(position: Vec3): Vec3 | undefined {
    const eyes = this.eyes_below(position);
    const rise = eyes && dot(sub(eyes, position), this.map.axes[2]);
    return rise !== undefined && Math.abs(rise) <= this.step ? eyes : undefined;
  }

  /** Comes to stand at most a step beside, however far below, and returns where the eyes are then. */
  eyes_below(position: Vec3): Vec3 | undefined {
    const stand = stand_around(this.map, position, Math.floor(this.map.step));
    if (stand) this.stand_ = stand;
    return stand && eyes_of(this.map, stand);
  }

  /** Where somebody would stand whose eyes are here: below, or nearby; else at the start of the map. */
  stand_at(position: Vec3): Stand {
    return stand_around(this.map, position, nearby_cells) ?? this.map.start;
  }

  walk(movement: Vec3): Vec3 {
    const [east, north] = this.map.axes;
    const { cell } = this.map;
    this.stand_ = move(
      this.map,
      this.stand_,
      dot(movement, east) / cell,
      dot(movement, north) / cell,
    );
    return eyes_of(this.map, this.stand_);
  }
}

// A storey as a dollhouse: seen from outside, without its ceiling. Pure.
import { add, dot, look_at, scale, sub, type Vec3 } from '../base/vector';
import type { ClipPlane, Eye } from '../camera/eye';
import { block_around, to_world, type Block, type WalkMap } from './walk_map';

const house_cells = 640; // 64 m for people of 1.6 m; what is larger is a landscape
const cut_cells = 20; // above the floor: higher than doors' handles, lower than ceilings
const below_storey_above_cells = 2;
const pitch_rad = (52 * Math.PI) / 180;
const margin = 1.1;

/** The block around a house; undefined where the scene is none: it is neither small nor has storeys. */
export async function house_around(map: WalkMap): Promise<Block | undefined> {
  const { storeys, tiles } = map;
  const is_house = storeys.length > 1 || Math.max(tiles.width, tiles.depth) <= house_cells;
  return is_house ? block_around(map, () => true) : undefined;
}

/** Cuts off all above a storey. */
export function ceiling_cut({ storeys, origin, axes, cell }: WalkMap, storey: number): ClipPlane {
  const { level } = storeys[storey]!;
  const above = storeys[storey + 1]?.low ?? Infinity;
  const height = Math.min(level + cut_cells, above - below_storey_above_cells);
  return { normal: axes[2], offset: dot(axes[2], origin) + height * cell };
}

/** From the south and above, so that all of the storey is in a view of this width / height. */
export function dollhouse_eye(
  map: WalkMap,
  around: Block,
  storey: number,
  fov_y_rad: number,
  aspect: number,
): { eye: Eye; focus: Vec3 } {
  const { west, south, east, north: end } = around;
  const middle = to_world(map, {
    east: (west + east) / 2,
    north: (south + end) / 2,
    height: map.storeys[storey]!.level,
  });
  const radius = (Math.hypot(east - west, end - south) / 2) * map.cell;
  const [, north, up] = map.axes;
  const half_rad = Math.min(fov_y_rad / 2, Math.atan(Math.tan(fov_y_rad / 2) * aspect));
  const distance = (margin * radius) / Math.sin(half_rad);
  const away = sub(scale(up, Math.sin(pitch_rad)), scale(north, Math.cos(pitch_rad)));
  const position = add(middle, scale(away, distance));
  return {
    eye: { position, orientation: look_at(position, middle, up), fov_y_rad },
    focus: middle,
  };
}

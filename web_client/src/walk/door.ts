// A door of 2 m as this map takes it, on the floor before a visitor. Pure.
import { add, dot, forward, normalize, rotate, scale, sub, type Vec3 } from '../base/vector';
import type { Eye } from '../camera/eye';
import { project } from '../camera/ray';
import { clear_near } from './map_walker';
import { cells_per_eye_height, to_grid, to_world, type WalkMap } from './walk_map';

const eyes_m = 1.6;
const cells_per_m = cells_per_eye_height / eyes_m;
const [half_width, height] = [0.45 * cells_per_m, 2 * cells_per_m];
const before_cells = 3 * cells_per_m;

/** Metres of a world unit, if a person of the map has usual eyes. */
export const metres_per_unit = (map: WalkMap): number =>
  Number((eyes_m / (cells_per_eye_height * map.cell)).toPrecision(3));

/** Its corners in the world; undefined: no floor is ahead. */
export function door_ahead(map: WalkMap, eye: Eye): readonly Vec3[] | undefined {
  const view = rotate(eye.orientation, forward);
  const [east_axis, north_axis, up] = map.axes;
  const level = normalize(sub(view, scale(up, dot(view, up))), north_axis);
  const [x, y] = [dot(level, east_axis), dot(level, north_axis)];
  const [east, north, eyes] = to_grid(map, eye.position);
  const feet = { east: east + x * before_cells, north: north + y * before_cells };
  const stand = clear_near(map, { ...feet, height: eyes - cells_per_eye_height });
  if (!stand) return undefined;
  const corner = (side: number, above: number): Vec3 =>
    add(
      to_world(map, { east: feet.east, north: feet.north, height: stand.height + above }),
      add(scale(east_axis, y * side * map.cell), scale(north_axis, -x * side * map.cell)),
    );
  return [
    corner(-half_width, 0),
    corner(-half_width, height),
    corner(half_width, height),
    corner(half_width, 0),
  ];
}

/** The corners in the view, as project() has them; undefined: the door is not seen. */
export function door_in_view(
  map: WalkMap,
  eye: Eye,
  aspect: number,
): readonly (readonly [x: number, y: number])[] | undefined {
  const corners = (door_ahead(map, eye) ?? []).flatMap((corner) => {
    const at = project(corner, eye, aspect);
    return at ? [at] : [];
  });
  if (corners.length < 4) return undefined; // there is none, or a part is behind the eye
  const is_seen = [0, 1].every((axis) => {
    const along = corners.map((at) => at[axis]!);
    return Math.max(...along) > 0 && Math.min(...along) < 1;
  });
  return is_seen ? corners : undefined;
}

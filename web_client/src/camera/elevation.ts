// Orthographic views of a box: from above, and of its four sides. Pure.
import { add, cross, dot, forward, from_axes, rotate, scale, type Vec3 } from '../base/vector';
import { limited_height, type Eye } from './eye';
import { upright_axes, type UprightBox } from './upright_box';

export const elevations = ['plan', 'front', 'right', 'back', 'left'] as const;
export type Elevation = (typeof elevations)[number];

/** Along the axes of the box: width, depth, up. */
const views: Readonly<Record<Elevation, readonly [view: Vec3, above: Vec3]>> = {
  plan: [
    [0, 0, -1],
    [0, 1, 0],
  ],
  front: [
    [0, 1, 0],
    [0, 0, 1],
  ],
  right: [
    [-1, 0, 0],
    [0, 0, 1],
  ],
  back: [
    [0, -1, 0],
    [0, 0, 1],
  ],
  left: [
    [1, 0, 0],
    [0, 0, 1],
  ],
};

const margin = 1.3; // the sides have handles, and the toolbar lies over the picture
const same_direction = 1 - 1e-5;

/** How far the box reaches along a unit vector. World units. */
export function extent_along({ size, turn_rad }: UprightBox, up: Vec3, direction: Vec3): number {
  const axes = upright_axes(up, turn_rad);
  return axes.reduce((sum, axis, i) => sum + Math.abs(dot(axis, direction)) * size[i]!, 0);
}

/** From an orthographic camera to the near face of a box so deep. The near plane cuts nothing of it. */
export const room_before = (extent: number, near_z: number): number =>
  Math.max(extent / 2, 3 * near_z);

/** All of the box, from outside. `aspect`: width over height of the view. `near_z`: of the scene. */
export function elevation_eye(
  elevation: Elevation,
  box: UprightBox,
  up: Vec3,
  aspect: number,
  fov_y_rad: number,
  near_z: number,
): Eye {
  const axes = upright_axes(up, box.turn_rad);
  const in_world = (v: Vec3): Vec3 => axes.map((axis, i) => scale(axis, v[i]!)).reduce(add);
  const [view, above] = views[elevation].map(in_world) as [Vec3, Vec3];
  const across = cross(view, above);
  const extent = (direction: Vec3): number => extent_along(box, up, direction);
  const distance = extent(view) / 2 + room_before(extent(view), near_z);
  return {
    position: add(box.centre, scale(view, -distance)),
    orientation: from_axes(across, scale(above, -1), view),
    fov_y_rad,
    view_height: limited_height(margin * Math.max(extent(above), extent(across) / aspect)),
  };
}

/** Which of the views an eye has, wherever it is. */
export function elevation_of(eye: Eye, turn_rad: number, up: Vec3): Elevation | undefined {
  if (eye.view_height === undefined) return undefined;
  const axes = upright_axes(up, turn_rad);
  const ahead = rotate(eye.orientation, forward);
  return elevations.find((elevation) => {
    const [view] = views[elevation];
    return axes.reduce((sum, axis, i) => sum + view[i]! * dot(axis, ahead), 0) > same_direction;
  });
}

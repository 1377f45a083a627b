import { describe, expect, it } from 'vitest';
import { conjugate, dot, rotate, sub, type Vec3 } from '#client/base/vector';
import { ceiling_cut, dollhouse_eye, is_house } from '#client/walk/dollhouse';
import { first_of, to_world, type Storey, type WalkMap } from '#client/walk/walk_map';

/** Ground everywhere, in a frame with y down. */
function map_of(width: number, depth: number, storeys: readonly Storey[]): WalkMap {
  const counts = new Uint8Array(width * depth).fill(1);
  return {
    origin: [5, 1, -2],
    axes: [[1, 0, 0], [0, 0, 1], [0, -1, 0]],
    cell: 0.1,
    step: 3,
    radius: 2,
    chest: 12,
    start: { east: 1, north: 1, height: 10 },
    storeys,
    width,
    depth,
    counts,
    first: first_of(counts),
    places: new Uint16Array(width * depth).fill((10 * 16) << 2),
  };
}
const one: Storey = { low: 0, level: 10, area: 100 };

describe('dollhouse', () => {
  it('is for houses', () => {
    expect(is_house(map_of(80, 70, [one]))).toBe(true);
    expect(is_house(map_of(1000, 70, [one]))).toBe(false);
    expect(is_house(map_of(1000, 70, [one, { low: 30, level: 40, area: 50 }]))).toBe(true);
    expect(is_house(map_of(80, 70, []))).toBe(false);
  });

  it('cuts above the heads of doors, and below the next storey', () => {
    const height = ({ normal, offset }: { normal: Vec3; offset: number }, map: WalkMap): number =>
      (offset - dot(normal, map.origin)) / map.cell;
    const house = map_of(80, 70, [one, { low: 24, level: 26, area: 50 }]);
    expect(height(ceiling_cut(house, 0), house)).toBeCloseTo(22);
    expect(height(ceiling_cut(house, 1), house)).toBeCloseTo(46);
  });

  it.each([16 / 9, 9 / 16])('shows all of the storey in a view of %f', (aspect) => {
    const map = map_of(80, 40, [one]);
    const fov_y_rad = 1;
    const { eye, focus } = dollhouse_eye(map, 0, fov_y_rad, aspect);
    const tan = Math.tan(fov_y_rad / 2);
    for (const [east, north] of [[0, 0], [80, 0], [0, 40], [80, 40]] as const) {
      const corner = to_world(map, { east, north, height: one.level });
      const [x, y, z] = rotate(conjugate(eye.orientation), sub(corner, eye.position));
      expect(z).toBeGreaterThan(0);
      expect(Math.abs(y / z)).toBeLessThan(tan);
      expect(Math.abs(x / z)).toBeLessThan(tan * aspect);
    }
    const [x, y, z] = rotate(conjugate(eye.orientation), sub(focus, eye.position));
    expect(Math.hypot(x, y)).toBeLessThan(1e-6);
    expect(z).toBeGreaterThan(0);
    const north_in_view = rotate(conjugate(eye.orientation), map.axes[1]);
    expect(north_in_view[1]).toBeLessThan(0); // upwards in the picture
  });
});

import { describe, expect, it } from 'vitest';
import { Signal } from '#client/base/signal';
import { conjugate, dot, identity, rotate, sub, type Vec3 } from '#client/base/vector';
import type { Eye } from '#client/camera/eye';
import type { CameraMode } from '#client/camera/mode';
import { Dollhouse } from '#client/walkable_area/dollhouse';
import { GestureRouter } from '#client/page/gestures';
import type { Clipping } from '#client/page/clipping';
import type { Navigation } from '#client/page/navigation';
import { ceiling_cut, dollhouse_eye, house_around } from '#client/walk/dollhouse';
import { to_world, type Block, type Stand, type Storey, type WalkMap } from '#client/walk/walk_map';
import { camera, expect_vec } from './cameras';
import { flat_tiles } from './walk_maps';

/** Ground everywhere, in a frame with y down. */
function map_of(width: number, depth: number, storeys: readonly Storey[]): WalkMap {
  return {
    origin: [5, 1, -2],
    axes: [
      [1, 0, 0],
      [0, 0, 1],
      [0, -1, 0],
    ],
    cell: 0.1,
    step: 3,
    radius: 2,
    chest: 12,
    start: { east: 1, north: 1, height: 10 },
    storeys,
    tiles: flat_tiles(width, depth, 10, () => true),
  };
}
const all_of = ({ tiles }: WalkMap): Block => ({
  west: 0,
  south: 0,
  east: tiles.width,
  north: tiles.depth,
});
const one: Storey = { low: 0, level: 10, area: 100 };

describe('dollhouse', () => {
  it('is for houses, around their ground', async () => {
    expect(await house_around(map_of(80, 70, [one]))).toEqual({
      west: 0,
      south: 0,
      east: 80,
      north: 70,
    });
    expect(await house_around(map_of(1000, 70, [one]))).toBeUndefined();
    expect(
      await house_around(map_of(1000, 70, [one, { low: 30, level: 40, area: 50 }])),
    ).toBeDefined();
    const yard = {
      ...map_of(200, 80, [one]),
      tiles: flat_tiles(200, 80, 10, (x, y) => x > 3 && x < 150 && y >= 66),
    };
    expect(await house_around(yard)).toEqual({ west: 4, south: 66, east: 150, north: 80 });
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
    const { eye, focus } = dollhouse_eye(map, all_of(map), 0, fov_y_rad, aspect);
    const tan = Math.tan(fov_y_rad / 2);
    for (const [east, north] of [
      [0, 0],
      [80, 0],
      [0, 40],
      [80, 40],
    ] as const) {
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

describe('a visitor of the dollhouse', () => {
  function enter() {
    const map = map_of(80, 70, [one, { low: 24, level: 26, area: 50 }]);
    const made = camera('fly');
    const clips: unknown[] = [];
    const chosen: Stand[] = [];
    const navigation = {
      camera: made,
      get eye() {
        return made.eye;
      },
      reach: 5,
      loop: { wake: () => undefined },
      taken_over: new Signal(),
      gestures: new GestureRouter(),
      set_mode: (mode: CameraMode) => made.set_mode(mode),
      // Straight down onto the middle of the floor.
      ray_at: () => ({
        origin: to_world(map, { east: 40, north: 35, height: 30 }),
        direction: [0, 1, 0] as const,
      }),
    };
    const house = new Dollhouse(
      {
        view: { clientWidth: 160, clientHeight: 90 } as HTMLElement,
        clipping: {
          set ceiling(plane: unknown) {
            clips.push(plane);
          },
        } as Clipping,
        navigation: navigation as unknown as Navigation,
        reduced_motion: true,
        go_to: (stand) => chosen.push(stand),
      },
      map,
      all_of(map),
    );
    const shown: boolean[] = [];
    house.changed.listen((now) => shown.push(now));
    const before = made.pose;
    house.show(0);
    made.step(0.016);
    return { house, map, made, clips, chosen, navigation, shown, before };
  }

  it('sees a storey from outside, and then another one', () => {
    const { house, map, made, clips, shown } = enter();
    expect(clips).toEqual([ceiling_cut(map, 0)]);
    expect(made.mode).toBe('orbit');
    const lower = made.pose.position;
    expect_vec(lower, dollhouse_eye(map, all_of(map), 0, made.fov_y_rad, 16 / 9).eye.position);
    house.show(1);
    made.step(0.016);
    expect(clips[1]).toEqual(ceiling_cut(map, 1));
    expect(made.pose.position[1]).toBeCloseTo(lower[1] - 1.6);
    expect(shown).toEqual([true]);
  });

  it('comes back to where they were', () => {
    const { house, made, clips, navigation, shown, before } = enter();
    house.leave();
    made.step(0.016);
    expect_vec(made.pose.position, before.position);
    expect_vec(made.pose.orientation, before.orientation);
    expect(made.mode).toBe('fly');
    expect(clips.at(-1)).toBeUndefined();
    expect(navigation.gestures.has('dollhouse')).toBe(false);
    expect(shown).toEqual([true, false]);
    house.leave();
    expect(clips).toHaveLength(2);
  });

  it('loses it when something else leads the camera, and is within the limits again', () => {
    const { house, made, clips } = enter();
    const from = made.pose.position;
    house.end();
    expect(house.shown).toBe(false);
    expect(clips.at(-1)).toBeUndefined();
    expect(made.mode).toBe('fly');
    expect(made.pose.position).toEqual(from);
    expect(made.within([99, 0, 0])).toEqual([20, 0, 0]);
  });

  it('is no way back from an orthographic view', () => {
    const plan: Eye = {
      position: [0, -99, 0],
      orientation: identity,
      fov_y_rad: 1,
      view_height: 8,
    };
    const { house, made, before } = enter();
    house.led_away();
    made.jump(plan);
    made.leave_orthographic();
    expect_vec(made.pose.position, before.position);
    made.jump(plan);
    house.show(0);
    made.step(0.016);
    house.leave();
    made.step(0.016);
    expect(made.is_orthographic).toBe(false);
    expect_vec(made.pose.position, before.position);
  });

  it('keeps the mode that they chose there', () => {
    const { house, made } = enter();
    made.set_mode('walk');
    house.leave();
    expect(made.mode).toBe('walk');
  });

  it('points at the floor, also after something else heard the taps', () => {
    const { navigation, chosen } = enter();
    navigation.gestures.set('measure', () => true);
    navigation.gestures.route({ x: 0.5, y: 0.5, how: 'click' });
    expect(chosen).toHaveLength(0);
    navigation.gestures.remove('measure');
    for (const how of ['click', 'double tap'] as const)
      navigation.gestures.route({ x: 0.5, y: 0.5, how });
    expect(chosen).toHaveLength(1);
    expect(chosen[0]).toMatchObject({ east: 40, north: 35 });
  });
});

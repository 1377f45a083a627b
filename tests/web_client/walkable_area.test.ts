// Visitors who walk in a scene, where they point, and the plan of it.
import { afterEach, beforeEach, describe, expect, it, vi } from 'vitest';
import { dot, length, look_at, rotate, sub, type Vec3 } from '#client/base/vector';
import { CameraController } from '#client/camera/camera_controller';
import { no_axes } from '#client/camera/movement';
import { WalkMapLoader } from '#client/walkable_area/walk_map_loader';
import { plan_picture } from '#client/walkable_area/plan_picture';
import { notes_of, sheet_for, with_resolution } from '#client/walkable_area/plan_sheet';
import { cells_of, px_of } from '#client/walkable_area/plan_view';
import { door_ahead, door_in_view, metres_per_unit } from '#client/walk/door';
import { floor_along } from '#client/walk/floor';
import { MapWalker } from '#client/walk/map_walker';
import { find_path } from '#client/walk/path';
import { areas_of } from '#client/walk/rooms';
import { stroll } from '#client/walk/stroll';
import {
  cells_per_eye_height,
  clear_at,
  eyes_of,
  to_grid,
  type Stand,
  type WalkMap,
} from '#client/walk/walk_map';
import { stand_below } from '#client/walk/walker';
import { text } from '#client/text/text';
import { MeasureList } from '#client/tour/measure_list';
import type { AccessToken } from '#client/session/token';
import { expect_vec } from './cameras';
import { flat_map, map, random_from } from './walk_maps';

const up: Vec3 = [0, 0, 1];
const eye_m = cells_per_eye_height * map.cell;

/** A walking camera at `position`, which looks along `ahead`. */
function walker(position: Vec3, ahead: Vec3, on: WalkMap = map): CameraController {
  const camera = new CameraController();
  camera.smoothing_s = 0;
  const to: Vec3 = [position[0] + ahead[0], position[1] + ahead[1], position[2] + ahead[2]];
  camera.load({
    up,
    start_pose: { position, orientation: look_at(position, to, up) },
    focus: to,
    limits_min: [0, 0, 0],
    limits_max: [0, 0, 0],
    near_z: 0.1,
    scale: 5,
  });
  camera.walker = new MapWalker(on);
  camera.set_mode('walk');
  return camera;
}

function hold(
  camera: CameraController,
  seconds: number,
  axes: Partial<typeof no_axes> = { forward: 1 },
): Vec3[] {
  return Array.from({ length: Math.round(seconds * 60) }, () => {
    camera.step(1 / 60, { ...no_axes, ...axes });
    return camera.pose.position;
  });
}

/** Lets what moves by itself end. */
function rest(camera: CameraController): void {
  for (let k = 0; k < 600 && !camera.at_rest; ++k) camera.step(1 / 60);
}

/** Who runs up stairs is lower for a moment. */
const is_clear = (on: WalkMap, point: Vec3): boolean => {
  const [east, north, height] = to_grid(on, point);
  const feet = height - cells_per_eye_height;
  return [-on.step, 0, on.step].some(
    (late) => clear_at(on, Math.floor(east), Math.floor(north), feet + late) >= 0,
  );
};

describe('walking', () => {
  it('comes down to the ground, and looks about level', () => {
    const camera = walker([-1, 1, 9], [1, 0, -3]);
    expect(camera.at_rest).toBe(true);
    camera.stand(new MapWalker(map).eyes_below([-1, 1, 9])!, false);
    rest(camera);
    expect_vec(camera.pose.position, [-1, 1, eye_m], 1);
    expect(dot(rotate(camera.pose.orientation, [0, 0, 1]), up)).toBeGreaterThan(-0.4);
  });

  it.each<[Vec3, number]>([
    [[-4, 1, eye_m], 0],
    [[-1, 1, 3], 0],
    [[-1, 1, eye_m + 0.2], 0.25],
    [[-1, 5, eye_m], 0.25],
  ])('moves a visitor at %j by no more than a step, whatever they press', (position, most) => {
    const camera = walker(position, [0, 0, 0]);
    rest(camera);
    expect(length(sub(camera.pose.position, position))).toBeLessThanOrEqual(most);
    camera.jump({ ...camera.pose, position });
    hold(camera, 1 / 60);
    rest(camera);
    expect(length(sub(camera.pose.position, position))).toBeLessThan(most + 0.1);
  });

  it('keeps eye height on stairs, without a jump', () => {
    const camera = walker([1, 0.75, eye_m], [1, 0, 0]);
    rest(camera);
    const way = hold(camera, 5);
    const heights = way.map(([, , z]) => z);
    expect(heights.at(-1)).toBeGreaterThan(2.72 + eye_m - 0.15);
    expect(way.at(-1)![0]).toBeGreaterThan(6.5);
    // A stair has 17 cm.
    expect(Math.max(...heights.slice(1).map((z, k) => Math.abs(z - heights[k]!)))).toBeLessThan(
      0.04,
    );
    rest(camera);
    const stand = stand_below(map, camera.pose.position)!;
    expect(length(sub(camera.pose.position, eyes_of(map, stand)))).toBeLessThan(0.05);
  });

  it('passes no wall and slides along it', () => {
    // The wall stands at x = 0 from y = 2 on.
    const camera = walker([-1, 4, eye_m], [1, 0.3, 0]);
    rest(camera);
    const way = hold(camera, 3);
    expect(Math.max(...way.map(([x]) => x))).toBeLessThan(0);
    expect(way.at(-1)![1]).toBeGreaterThan(4.2);
    hold(camera, 3, { up: 1 });
    expect(camera.pose.position[2]).toBeCloseTo(eye_m, 1);
  });

  it('stays on clear ground in ten minutes of any keys', () => {
    const camera = walker([-1, 1, eye_m], [1, 0, 0]);
    rest(camera);
    const random = random_from(3);
    let axes: Partial<typeof no_axes> = {};
    for (let frame = 0; frame < 10 * 60 * 60; ++frame) {
      if (frame % 40 === 0)
        axes = {
          forward: random() - 0.3,
          right: random() - 0.5,
          turn_right: random() - 0.5,
          up: random() - 0.5,
          fast: random() < 0.3,
        };
      camera.step(1 / 60, { ...no_axes, ...axes });
      const { position } = camera.pose;
      if (!is_clear(map, position)) throw new Error(`frame ${frame}: at ${position.join(' ')}`);
    }
  }, 60_000);

  it('leaves flying and orbiting free', () => {
    const camera = walker([-1, 4, eye_m], [1, 0, 0]);
    rest(camera);
    camera.set_mode('fly');
    hold(camera, 2);
    expect(camera.pose.position[0]).toBeGreaterThan(1);
    expect(camera.pose.position[2]).toBeCloseTo(eye_m, 2);
  });

  it('finds the ground again after somebody else has moved the camera', () => {
    const camera = walker([-1, 1, eye_m], [1, 0, 0]);
    rest(camera);
    camera.jump({ ...camera.pose, position: [9, 5, 4.5] });
    hold(camera, 0.1);
    rest(camera);
    expect(camera.pose.position[2]).toBeCloseTo(2.72 + eye_m, 1);
  });
});

describe('a door before the author', () => {
  it('has 2 m where eyes have 1.6 m, and stands on the floor', () => {
    const position: Vec3 = [-1, 1, eye_m];
    const orientation = look_at(position, [-1, 9, eye_m - 1], up);
    const [left, above, , right] = door_ahead(map, { position, orientation, fov_y_rad: 1 })!;
    expect_vec(sub(above!, left!), [0, 0, (2 / 1.6) * eye_m], 3);
    expect_vec(sub(right!, left!), [(0.9 / 1.6) * eye_m, 0, 0], 3);
    expect(left![2]).toBeCloseTo(0, 1);
    expect(metres_per_unit({ ...map, cell: 0.2 })).toBeCloseTo(0.5, 2);
  });

  it('stands nowhere without a floor', () => {
    const eye = {
      position: [-90, 1, eye_m] as Vec3,
      orientation: look_at([0, 0, 0], [1, 0, 0], up),
      fov_y_rad: 1,
    };
    expect(door_ahead(map, eye)).toBeUndefined();
    expect(door_in_view(map, eye, 1)).toBeUndefined();
  });

  it.each([
    ['ahead', eye_m, true],
    ['below the view of those who look up', eye_m + 90, false],
  ])('is seen only in the view: %s', (_, height, seen) => {
    const position: Vec3 = [-1, 1, eye_m];
    const orientation = look_at(position, [-1, 9, height], up);
    expect(door_in_view(map, { position, orientation, fov_y_rad: 1 }, 1.6) !== undefined).toBe(
      seen,
    );
  });

  it('gives measures and plans their scale at once', () => {
    const measures = new MeasureList();
    const heard: unknown[] = [];
    measures.changed.listen(() => heard.push(measures.metres_per_unit));
    measures.set_scale(metres_per_unit({ ...map, cell: 0.2 }));
    expect(heard).toEqual([0.5]);
    measures.set_scale(0.5);
    expect(heard).toEqual([0.5]);
  });
});

describe('pointing at the floor', () => {
  const ray = (origin: Vec3, to: Vec3) => {
    const way = sub(to, origin);
    const n = length(way);
    return { origin, direction: [way[0] / n, way[1] / n, way[2] / n] as const };
  };
  const point = (stand: Stand | undefined): Vec3 | undefined =>
    stand && eyes_of(map, { ...stand, height: stand.height - cells_per_eye_height });

  it('finds where the ray meets it, on each floor', () => {
    expect_vec(point(floor_along(map, ray([-1, 1, eye_m], [1, 3, 0])))!, [-0.4, 1.6, 0], -1);
    const hit = point(floor_along(map, ray([-1.5, 1, eye_m], [-0.8, 0.8, 0])))!;
    expect(length(sub(hit, [-0.8, 0.8, 0]))).toBeLessThan(0.1);
    const upper = point(floor_along(map, ray([9, 5, 2.72 + eye_m], [7.5, 4.5, 2.72])))!;
    expect(length(sub(upper, [7.5, 4.5, 2.72]))).toBeLessThan(0.1);
    const stair = point(floor_along(map, ray([0.5, 0.75, eye_m], [4.1, 0.75, 1.36])))!;
    expect(stair[2]).toBeGreaterThan(0.5);
  });

  it('stops before a wall', () => {
    const before = point(floor_along(map, ray([-1.5, 4, eye_m], [3, 4, 0.1])))!;
    expect(before[0]).toBeGreaterThan(-1);
    expect(before[0]).toBeLessThan(0);
  });

  it('finds nothing in the sky', () => {
    expect(floor_along(map, ray([-1, 1, eye_m], [5, 1, 9]))).toBeUndefined();
    expect(floor_along(map, ray([-1, 1, eye_m], [-1, 1, 9]))).toBeUndefined();
    expect(floor_along(map, ray([500, 1, eye_m], [600, 1, 0]))).toBeUndefined();
  });

  it('is right below', () => {
    expect(
      length(sub(point(floor_along(map, ray([-1, 1, eye_m], [-1, 1, 0])))!, [-1, 1, 0])),
    ).toBeLessThan(0.1);
  });
});

describe('a walk to a place', async () => {
  const from = stand_below(map, [-1, 1, eye_m])!;
  const to = stand_below(map, [9, 5, 2.72 + eye_m])!;
  const start: Vec3 = eyes_of(map, from);
  const eye = { position: start, orientation: look_at(start, [-5, 1, eye_m], up), fov_y_rad: 1 };
  const way = stroll(map, await find_path(map, from, to), eye);

  it('begins with the present view and ends at the place', () => {
    expect_vec(way.at(0).position, start, 5);
    expect_vec(way.at(0).orientation, eye.orientation, 5);
    expect(length(sub(way.at(way.duration_s).position, eyes_of(map, to)))).toBeLessThan(0.05);
    expect(way.duration_s).toBeLessThan(11);
  });

  it('has no jump, climbs the stairs, and looks where it goes', () => {
    let before = way.at(0);
    const longest = 1.6 * (way.duration_s > 10 ? 3 : 1.25) * eye_m;
    for (let t = 1 / 60; t < way.duration_s; t += 1 / 60) {
      const now = way.at(t);
      const step = sub(now.position, before.position);
      expect(length(step) * 60).toBeLessThan(longest);
      expect(Math.abs(step[2])).toBeLessThan(0.05);
      if (t > 1.5 && t < way.duration_s - 1.5) {
        const view = rotate(now.orientation, [0, 0, 1]);
        expect(dot(view, step) / length(step)).toBeGreaterThan(0.3);
      }
      before = now;
    }
  });

  it('of no length stays', () => {
    const stays = stroll(map, [from, from], eye);
    expect_vec(stays.at(stays.duration_s).position, start, 4);
  });
});

describe('the plan', () => {
  it('shows ground, walls and what is not known', async () => {
    const yard = flat_map(30, 20, (x) => x !== 12);
    const { width, height, rgba, cells } = await plan_picture(yard, 0);
    expect([width, height, cells]).toEqual([30, 20, 1]);
    const pixel = (x: number, y: number): number[] => [
      ...rgba.slice(4 * (y * width + x), 4 * (y * width + x) + 4),
    ];
    expect(pixel(3, 3)).toEqual([255, 255, 255, 255]);
    expect(pixel(12, 3)).toEqual([0, 0, 0, 0]);
  });

  it('has a picture of each storey', async () => {
    const ground = await plan_picture(map, 0);
    const upper = await plan_picture(map, 1);
    expect(upper.east).toBeGreaterThan(ground.east);
    const dark = (rgba: Uint8ClampedArray): number =>
      rgba.filter((value, i) => i % 4 === 0 && value === 41 && rgba[i + 3] === 255).length;
    expect(dark(ground.rgba)).toBeGreaterThan(20);
    expect(dark(upper.rgba)).toBeGreaterThan(10);
  });

  it('leads from places to pixels and back', () => {
    const view = { east: 40, north: 30, px_per_cell: 3, up_rad: 0, width_px: 200, height_px: 100 };
    expect(px_of(view, 41, 30)).toEqual([103, 50]);
    expect(px_of(view, 40, 31)).toEqual([100, 47]);
    // Looking east, east is up and north is left.
    const turned = { ...view, up_rad: Math.PI / 2 };
    expect_vec(px_of(turned, 41, 30), [100, 47]);
    expect_vec(px_of(turned, 40, 31), [97, 50]);
    for (const up_rad of [0, 1, -2.5])
      expect_vec(cells_of({ ...view, up_rad }, ...px_of({ ...view, up_rad }, 17, 55)), [17, 55]);
  });
});

describe('a walk map that the server still computes', () => {
  const asked = vi.fn(() =>
    Promise.resolve(new Response(null, { status: 202, headers: { 'retry-after': '5' } })),
  );
  const told = vi.fn();
  let loader: WalkMapLoader;

  beforeEach(() => {
    vi.useFakeTimers();
    vi.stubGlobal('fetch', asked);
    vi.stubGlobal('location', { href: 'http://host/' });
    asked.mockClear();
    told.mockClear();
    loader = new WalkMapLoader({ value: '' } as AccessToken);
    loader.computing.listen(told);
    loader.enter('hall');
  });

  afterEach(() => {
    loader.enter(''); // nobody asks on
    vi.useRealTimers();
  });

  it('is announced once in each scene to those who wait for it', async () => {
    void loader.want();
    await vi.advanceTimersByTimeAsync(1);
    expect(told).toHaveBeenCalledTimes(1);
    void loader.want();
    await vi.advanceTimersByTimeAsync(12_000);
    expect(asked).toHaveBeenCalledTimes(3);
    expect(told).toHaveBeenCalledTimes(1);
    loader.enter('tower');
    void loader.want();
    await vi.advanceTimersByTimeAsync(1);
    expect(told).toHaveBeenCalledTimes(2);
  });

  it('is not announced where there is none', async () => {
    void loader.want(true);
    await vi.advanceTimersByTimeAsync(1);
    asked.mockResolvedValueOnce({ status: 404, headers: new Headers() } as Response);
    await vi.advanceTimersByTimeAsync(12_000);
    void loader.want();
    await vi.advanceTimersByTimeAsync(1);
    expect(told).not.toHaveBeenCalled();
  });

  it('is announced at once to somebody who begins to wait for it', async () => {
    void loader.want(true);
    await vi.advanceTimersByTimeAsync(6000);
    expect(told).not.toHaveBeenCalled();
    void loader.want();
    expect(told).toHaveBeenCalledTimes(1);
  });
});

describe('the areas of a storey', () => {
  /** Two rooms of 30x30 and 20x30 columns with a wall between them and a door of `door` columns. */
  const two_rooms = (door: number): WalkMap =>
    flat_map(70, 40, (x, y) => {
      const inside = x >= 5 && x < 56 && y >= 5 && y < 35;
      return inside && (x !== 35 || Math.abs(y - 20) < door / 2);
    });

  it('are those of rooms, which doors separate', async () => {
    const { cells, rooms } = await areas_of(two_rooms(9), 0, true);
    expect(cells).toBe(51 * 30 - 30 + 9);
    expect(rooms.map((room) => Math.round(room.cells / 10))).toEqual([91, 60]);
    expect(rooms.reduce((sum, room) => sum + room.cells, 0)).toBe(cells);
    const [large, small] = rooms;
    expect(Math.hypot(large!.east - 20, large!.north - 20)).toBeLessThan(2);
    expect(small!.east).toBeGreaterThan(36);
    expect(Math.abs(small!.radius - 10)).toBeLessThan(1.5);
  });

  it('are those of one room where an opening is wider than a door', async () => {
    expect((await areas_of(two_rooms(20), 0, true)).rooms).toHaveLength(1);
  });

  it('have no rooms out of doors, and none where nobody can stand', async () => {
    expect((await areas_of(two_rooms(9), 0, false)).rooms).toEqual([]);
    expect(
      await areas_of(
        flat_map(70, 40, () => false),
        0,
        true,
      ),
    ).toEqual({ cells: 0, rooms: [] });
  });
});

describe('a printed plan', () => {
  const metric = { metres_per_unit: 1, system: 'metric', cell: 0.1 } as const;

  it('has a usual scale at which the storey fits the paper, upright or across', () => {
    const upright = sheet_for(100, 150, metric);
    expect(upright).toMatchObject({ name: 'A4', width_px: 2520, height_px: 3564, denominator: 75 });
    const across = sheet_for(150, 100, metric);
    expect(across).toMatchObject({ width_px: 3564, height_px: 2520, denominator: 75 });
    // 10 m at 1:75 are 133 mm of 12 px each.
    expect(upright.px_per_cell * 100).toBeCloseTo((10_000 / 75) * 12);
    for (const { inner, px_per_cell } of [upright, across])
      expect(100 * px_per_cell).toBeLessThan(Math.min(...inner));
    expect(sheet_for(100, 150, { ...metric, system: 'imperial' }).name).toBe('Letter');
  });

  it('fills the paper where nobody knows the scale', () => {
    const { inner, px_per_cell, denominator } = sheet_for(100, 400, {
      ...metric,
      metres_per_unit: undefined,
    });
    expect(denominator).toBeUndefined();
    expect(notes_of({ ...metric, metres_per_unit: undefined })).toContain(text.measure.no_scale);
    expect(notes_of(metric)).not.toContain(text.measure.no_scale);
    expect(400 * px_per_cell).toBeCloseTo(inner[1]);
  });

  it('says its resolution, so that it prints at its size', () => {
    const png = new Uint8Array(60).fill(7);
    const sized = with_resolution(png);
    expect(Buffer.from(sized.subarray(33, 54)).toString('hex')).toBe(
      '000000097048597300002ee000002ee0010f0ed7e1',
    );
    expect(sized.subarray(0, 33)).toEqual(png.subarray(0, 33));
    expect(sized.subarray(54)).toEqual(png.subarray(33));
  });
});

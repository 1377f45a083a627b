// Where a visitor with a headset is in the scene, and what their hands ask for.
import { describe, expect, it } from 'vitest';
import {
  add,
  axis_angle,
  dot,
  forward,
  identity,
  look_at,
  rotate,
  scale,
  type Vec3,
} from '#client/base/vector';
import type { Pose } from '#client/camera/eye';
import { landing, thrown } from '#client/headset/arc';
import { facing, met_plate } from '#client/headset/plate';
import { Rig } from '#client/headset/rig';
import { TurnStick, without_drift } from '#client/headset/stick';
import { expect_vec } from './cameras';
import { flat_map } from './walk_maps';

const up: Vec3 = [0, -1, 0];
const degrees = (angle: number): number => (angle * Math.PI) / 180;

describe('the room of a visitor', () => {
  const head: Pose = {
    position: [0.5, -1.7, 0.3],
    orientation: axis_angle([0, 1, 0], degrees(40)),
  };
  const heading = (rig: Rig): Vec3 => rotate(rig.to_world(head).orientation, forward);

  it('puts the eyes where the camera of the page is, level and heading its way', () => {
    const rig = new Rig(up, 2);
    const position: Vec3 = [10, -4, 20];
    rig.place({ position, orientation: look_at(position, [14, 0, 20], up) }, head);
    expect_vec(rig.to_world(head).position, position, 6);
    expect_vec(heading(rig), [1, 0, 0], 6);
    expect_vec(rig.direction([0, 1, 0]), [0, 1, 0], 6);
  });

  it('has its floor on that of the scene', () => {
    const rig = new Rig(up, 2);
    rig.place({ position: [10, -3.2, 20], orientation: identity }, head, [10, 0.4, 20]);
    expect_vec(rig.floor_below(head), [10, 0.4, 20], 6);
    expect_vec(rig.to_world(head).position, [10, 0.4 - 3.4, 20], 6);
  });

  it.each([
    ['down', [0, 1, 0]],
    ['up', [0, -1, 0]],
  ] as const)('keeps the heading of a camera that looks straight %s', (_, direction) => {
    const rig = new Rig(up, 1);
    // The upper edge of a view downwards shows what the lower edge of a view upwards shows.
    const ahead: Vec3 = [0, 0, 1];
    const orientation = look_at([0, 0, 0], add(direction, scale(ahead, 1e-3)), up);
    rig.place({ position: [0, 0, 0], orientation }, head);
    expect(dot(heading(rig), ahead)).toBeGreaterThan(0.99);
  });

  it('stands upright in scenes whose up is another', () => {
    const other: Vec3 = [0, 0, 1];
    const rig = new Rig(other, 1);
    rig.place({ position: [1, 2, 3], orientation: look_at([1, 2, 3], [1, 9, 3], other) }, head);
    expect_vec(rig.direction([0, -1, 0]), other, 6);
    expect_vec(heading(rig), [0, 1, 0], 6);
    expect_vec(rig.to_room(rig.to_world(head).position), head.position, 6);
  });

  it('turns to the right about the visitor', () => {
    const rig = new Rig(up, 3);
    rig.place({ position: [1, -2, 3], orientation: identity }, head);
    const before = rig.to_world(head).position;
    rig.turn(degrees(90), head);
    expect_vec(rig.to_world(head).position, before, 6);
    expect_vec(heading(rig), [1, 0, 0], 6);
  });

  it('takes the visitor to where they want to stand, without a turn', () => {
    const rig = new Rig(up, 1);
    rig.place({ position: [1, -2, 3], orientation: identity }, head);
    const before = heading(rig);
    rig.stand_at([4, 0, 4], head);
    expect_vec(rig.floor_below(head), [4, 0, 4], 6);
    expect_vec(heading(rig), before, 6);
  });
});

describe('the arc of a teleport', () => {
  const down: Vec3 = [0, 0, -1];
  const map = flat_map(200, 200, () => true);
  const [east, north, height] = map.axes;
  const at = (x: number, y: number, z: number): Vec3 =>
    add(map.origin, add(scale(east, x), add(scale(north, y), scale(height, z))));

  it('falls as things do', () => {
    const points = thrown([0, 0, 0], [1, 0, 0], down);
    const second = points[30]!;
    expect(second[0]).toBeCloseTo(8, 6);
    expect(second[2]).toBeCloseTo(-9.81 / 2, 6);
  });

  it('ends on the floor that it meets', () => {
    // The floor is 1 m up, and the hand 1.25 m above it.
    const { stand, points } = landing(map, thrown(at(2, 2, 2.25), east, scale(height, -1)));
    expect(stand?.height).toBeCloseTo(10, 6);
    expect(stand!.east * map.cell).toBeCloseTo(2 + 8 * Math.sqrt((2 * 1.25) / 9.81), 0);
    expect(stand!.north * map.cell).toBeCloseTo(2, 1);
    expect(points).toBeGreaterThan(5);
  });

  it('ends at a ceiling, not on the floor above it', () => {
    // The floor is 1 m up, and the hand is 0.5 m below it.
    const { stand, points } = landing(map, thrown(at(2, 2, 0.5), height, scale(height, -1)));
    expect(stand).toBeUndefined();
    expect(points).toBeLessThan(5);
  });

  it('ends nowhere where there is no floor', () => {
    const hole = flat_map(200, 200, (x) => x < 30);
    expect(landing(hole, thrown(at(2, 2, 2.25), east, scale(height, -1))).stand).toBeUndefined();
  });
});

describe('a plate in the room', () => {
  const plate = facing([0, -1, 2], [0, -1, 0], 0.5, 0.25);

  it('is met where a ray goes through it', () => {
    const met = met_plate({ origin: [0, -1, 0], direction: [0, 0, 1] }, plate);
    expect(met).toMatchObject({ x: 0.5, y: 0.5, distance: 2 });
    const aside = met_plate({ origin: [0.25, -1.125, 0], direction: [0, 0, 1] }, plate)!;
    expect(aside.x).toBeCloseTo(0.75, 6);
    expect(aside.y).toBeCloseTo(0.25, 6);
  });

  it('is not met beside it, nor by who looks away', () => {
    expect(met_plate({ origin: [0.6, -1, 0], direction: [0, 0, 1] }, plate)).toBeUndefined();
    expect(met_plate({ origin: [0, -1, 0], direction: [0, 0, -1] }, plate)).toBeUndefined();
  });
});

describe('a stick', () => {
  it('turns once for each push to a side', () => {
    const stick = new TurnStick();
    const turns = [0, 0.5, 0.9, 1, 0.6, 0.9, 0.1, -0.9].map((x) => stick.move(x, 0).turn);
    expect(turns).toEqual([0, 0, 1, 0, 0, 0, 0, -1]);
  });

  it('aims from a push ahead until its release, and does not turn meanwhile', () => {
    const stick = new TurnStick();
    expect(stick.move(0, -0.9).aim).toBe('begins');
    expect(stick.move(0.8, -0.5)).toEqual({ turn: 0, aim: undefined });
    expect(stick.move(0, -0.1).aim).toBe('ends');
    expect(stick.move(0, 0.9).aim).toBeUndefined();
  });

  it('moves nobody by its drift', () => {
    expect(without_drift(0.1, -0.1)).toEqual([0, 0]);
    expect(without_drift(0.5, -0.1)).toEqual([0.5, -0.1]);
  });
});

// Walking, flights, and the glide after a gesture.
import { describe, expect, it } from 'vitest';
import {
  angle_between,
  axis_angle,
  identity,
  look_at,
  rotate,
  slerp,
  type Vec3,
} from '#client/base/vector';
import type { Eye } from '#client/camera/eye';
import { glide, glide_time_s } from '#client/camera/flight';
import { Inertia } from '#client/camera/inertia';
import { project, ray_through, surface_of } from '#client/camera/ray';
import type { SceneSetup } from '#client/camera/scene_setup';
import { Taps } from '#client/input/pointers';
import { camera, expect_vec, hold, scene, view_of } from './cameras';

const eye_level: Partial<SceneSetup> = {
  start_pose: { position: [0, -1.7, -5], orientation: identity },
  focus: [0, -1.7, 0],
};

const eye = (position: Vec3, yaw: number): Eye => ({
  position,
  orientation: axis_angle([0, -1, 0], yaw),
  fov_y_rad: 1,
});

describe('walking', () => {
  it('keeps its height, wherever it looks', () => {
    const made = camera('walk', eye_level);
    made.gesture({ kind: 'look', dx: 0, dy: -0.4 });
    hold(made, { forward: 1 });
    const [, height, z] = made.pose.position;
    expect(height).toBe(-1.7);
    expect(z).toBeGreaterThan(-4);
    made.gesture({ kind: 'dolly', steps: 2 });
    made.gesture({ kind: 'pan', dx: 0.1, dy: 0.2 });
    hold(made, {}, 0.1);
    expect(made.pose.position[1]).toBe(-1.7);
    expect(made.pose.position[2]).toBeGreaterThan(z);
  });

  it('is as fast uphill as ahead', () => {
    const level = camera('walk', eye_level);
    const looks_down = camera('walk', eye_level);
    looks_down.gesture({ kind: 'look', dx: 0, dy: -0.9 });
    looks_down.step(0.1);
    hold(level, { forward: 1 });
    hold(looks_down, { forward: 1 });
    expect(looks_down.pose.position[2]).toBeCloseTo(level.pose.position[2], 3);
  });

  it('changes its height by Q and E only', () => {
    const made = camera('walk', eye_level);
    hold(made, { up: 1 });
    expect(made.pose.position[1]).toBeLessThan(-2);
  });

  it('goes to a place that was pointed at, up to a step before it', () => {
    const made = camera('walk', eye_level);
    made.focus_on([6, 0, -5]);
    expect(made.at_rest).toBe(false);
    hold(made, {}, 10);
    expect(made.at_rest).toBe(true);
    const [x, y, z] = made.pose.position;
    expect(y).toBeCloseTo(-1.7, 6);
    expect(z).toBeCloseTo(-5, 6);
    expect(x).toBeCloseTo(5.5, 6);
    expect_vec(view_of(made), [1, 0, 0]);
  });
});

describe('a double click', () => {
  it('turns an orbiting camera to the place, which it then goes around', () => {
    const made = camera('orbit', eye_level);
    made.focus_on([2, -1.7, 1]);
    hold(made, {}, 10);
    const view = view_of(made);
    const [x, , z] = made.pose.position;
    expect(view[0] / view[2]).toBeCloseTo((2 - x) / (1 - z), 4);
    const before = made.sight_distance;
    made.gesture({ kind: 'look', dx: 0.2, dy: 0 });
    hold(made, {}, 0.1);
    expect(made.sight_distance).toBeCloseTo(before, 4);
    const turned = view_of(made);
    expect(turned[0]).not.toBeCloseTo(view[0], 2);
  });

  it('tells taps, double taps at one place in a short time, and drags', () => {
    const taps = new Taps();
    const tap = (time_ms: number, x: number, drag = 0): string => {
      taps.down(x, 10, true);
      return taps.up(time_ms, x + drag, 10);
    };
    expect(tap(0, 10)).toBe('tap');
    expect(tap(200, 12)).toBe('double tap');
    expect(tap(300, 12)).toBe('tap');
    expect(tap(900, 12)).toBe('tap');
    expect(tap(1000, 90)).toBe('tap');
    expect(tap(1100, 90, 40)).toBe('drag');
    taps.down(90, 10, false); // a second finger
    expect(taps.up(1150, 90, 10)).toBe('drag');
    taps.down(90, 10, true);
    taps.cancel(); // by a long press
    expect(taps.up(1900, 90, 10)).toBe('drag');
  });

  it('sends a ray to what is seen there', () => {
    const at = eye([1, 2, 3], 0.4);
    const { origin, direction } = ray_through(at, 0.3, 0.8, 1.5);
    const point = origin.map((v, i) => v + direction[i]! * 7) as unknown as Vec3;
    const [x, y] = project(point, at, 1.5)!;
    expect(x).toBeCloseTo(0.3, 6);
    expect(y).toBeCloseTo(0.8, 6);
    const back = origin.map((v, i) => v - direction[i]!) as unknown as Vec3;
    expect(project(back, at, 1.5)).toBeUndefined();
  });

  it('takes four points of the view for a surface that faces the eye', () => {
    const [left, right, top, bottom]: Vec3[] = [
      [-1, 2, 5],
      [1, 2, 5],
      [0, 2, 6],
      [0, 2, 4],
    ];
    const floor = surface_of([left, right, top, bottom], [0, 0, 0])!;
    expect(floor.point).toEqual([0, 2, 5]);
    expect(floor.normal.map((v) => Math.round(v * 1e9) / 1e9 + 0)).toEqual([0, -1, 0]);
    expect(surface_of([left, right, top, bottom], [0, 9, 0])!.normal[1]).toBeCloseTo(1, 9);
    expect(surface_of([left, right, undefined, bottom], [0, 0, 0])).toBeUndefined();
    expect(surface_of([left, right, left, right], [0, 0, 0])).toBeUndefined();
  });
});

describe('a flight', () => {
  const from = eye([0, 0, 0], 0);
  const to = eye([4, 0, 2], 1);

  it('begins and ends at rest', () => {
    const way = glide(from, to, 2);
    expect_vec(way.at(0).position, from.position);
    expect_vec(way.at(2).position, to.position);
    expect(angle_between(way.at(2).orientation, to.orientation)).toBeLessThan(1e-6);
    expect(way.at(0.02).position[0]).toBeLessThan(1e-4);
    expect(way.at(1).position[0]).toBeCloseTo(2, 6);
  });

  it('takes longer for longer ways and turns, within bounds', () => {
    expect(glide_time_s(from, from, 1)).toBe(0.6);
    expect(glide_time_s(from, eye([0, 0, 0], 2), 1)).toBeCloseTo(2 / 0.7, 5);
    expect(glide_time_s(from, eye([999, 0, 0], 0), 1)).toBe(6);
  });

  it('ends when the visitor takes over, and says whether it arrived', () => {
    const heard: boolean[] = [];
    const made = camera('fly', eye_level);
    made.fly(glide(made.eye, to, 1), (arrived) => heard.push(arrived));
    hold(made, {}, 0.5);
    made.gesture({ kind: 'look', dx: 0.1, dy: 0 });
    made.fly(glide(made.eye, to, 1), (arrived) => heard.push(arrived));
    hold(made, {}, 0.5);
    hold(made, { forward: 1 }, 0.1);
    made.fly(glide(made.eye, to, 0.5), (arrived) => heard.push(arrived));
    hold(made, {}, 1);
    expect(heard).toEqual([false, false, true]);
    expect_vec(made.pose.position, to.position);
    expect(made.at_rest).toBe(true);
  });

  it('ends with the scene', () => {
    const heard: boolean[] = [];
    const made = camera('fly', eye_level);
    made.fly(glide(made.eye, to, 1), (arrived) => heard.push(arrived));
    made.load({ ...scene, ...eye_level, start_pose: { ...scene.start_pose, position: [1, 2, 3] } });
    hold(made, {}, 2);
    expect(heard).toEqual([false]);
    expect_vec(made.pose.position, [1, 2, 3]);
  });
});

describe('orientations', () => {
  it('look at a point with up upright, in all directions', () => {
    for (const to of [
      [0, 0, 5],
      [0, 0, -5],
      [5, 1, 0],
      [-5, -2, 1],
      [1, -3, -2],
    ] as Vec3[]) {
      const q = look_at([0, 0, 0], to, [0, -1, 0]);
      const size = Math.hypot(...to);
      expect_vec(rotate(q, [0, 0, 1]), to.map((v) => v / size) as unknown as Vec3);
      expect(rotate(q, [1, 0, 0])[1]).toBeCloseTo(0, 6);
      expect(rotate(q, [0, 1, 0])[1]).toBeGreaterThan(0);
    }
  });

  it('go the short way round', () => {
    const a = axis_angle([0, 1, 0], 0.2);
    const b = axis_angle([0, 1, 0], 1);
    const minus_b = b.map((v) => -v) as unknown as typeof b;
    for (const target of [b, minus_b]) {
      expect(angle_between(slerp(a, target, 0.25), axis_angle([0, 1, 0], 0.4))).toBeLessThan(1e-6);
    }
  });
});

describe('inertia', () => {
  const flick = (inertia: Inertia, pause_ms = 10): boolean => {
    for (let t = 0; t <= 80; t += 10) inertia.moved({ kind: 'look', dx: 0.01, dy: 0 }, t);
    return inertia.released(80 + pause_ms);
  };

  it('continues as fast as the pointer went, and fades', () => {
    const inertia = new Inertia();
    expect(flick(inertia)).toBe(true);
    const first = inertia.step(0.01)!;
    if (first.kind !== 'look') throw new Error(first.kind);
    expect(first.dx).toBeCloseTo(0.01, 2);
    let way = first.dx;
    for (let i = 0; i < 300 && inertia.active; ++i) {
      const step = inertia.step(0.01);
      if (step?.kind === 'look') way += step.dx;
    }
    expect(inertia.active).toBe(false);
    expect(way).toBeGreaterThan(0.2);
    expect(way).toBeLessThan(0.29);
  });

  it('needs a pointer that was moving, and no pinch', () => {
    expect(flick(new Inertia(), 100)).toBe(false);
    const pinched = new Inertia();
    pinched.moved({ kind: 'dolly', steps: 1 }, 0);
    pinched.moved({ kind: 'look', dx: 0.1, dy: 0 }, 5);
    expect(pinched.released(6)).toBe(false);
    const reduced = new Inertia();
    reduced.enabled = false;
    expect(flick(reduced)).toBe(false);
  });

  it('ends with the next gesture', () => {
    const inertia = new Inertia();
    flick(inertia);
    inertia.moved({ kind: 'look', dx: 0, dy: 0 }, 200);
    expect(inertia.step(0.1)).toBeUndefined();
  });
});

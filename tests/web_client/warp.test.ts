import { describe, expect, it } from 'vitest';
import {
  add,
  angle_between,
  axis_angle,
  identity,
  multiply,
  rotate,
  type Vec3,
} from '#client/base/vector';
import { widened_fov, type Eye } from '#client/camera/eye';
import { project } from '#client/camera/ray';
import { TurnForecast } from '#client/present/turn_forecast';
import { can_show, reach, uncovered_share, warp_matrix, warped } from '#client/present/warp';
import { WarpPolicy } from '#client/present/warp_policy';
import golden from '../support/warp_golden.json';

const aspect = 16 / 9;
const up: Vec3 = [0, -1, 0];

const eye = (change: Partial<Eye> = {}): Eye => ({
  position: [0, 0, 0],
  orientation: identity,
  fov_y_rad: 1,
  ...change,
});

/** Place of a point of the scene in the image of an eye, -1…1. */
function seen(point: Vec3, by: Eye): readonly [number, number] {
  const [x, y] = project(point, by, aspect)!;
  return [2 * x - 1, 2 * y - 1];
}

function expect_same_place(point: Vec3, picture: Eye, view: Eye, distance: number): void {
  const [x, y] = seen(point, view);
  const at = warped(warp_matrix(picture, view, aspect, distance), x, y)!;
  const [px, py] = seen(point, picture);
  expect(at[0]).toBeCloseTo(px, 5);
  expect(at[1]).toBeCloseTo(py, 5);
}

describe('a warped picture', () => {
  const turn = multiply(axis_angle(up, 0.1), axis_angle([1, 0, 0], -0.05));

  it('shows far things where they are, whatever turn, roll and field of view', () => {
    const picture = eye({ fov_y_rad: widened_fov(1, 1.26) });
    const view = eye({ orientation: multiply(turn, axis_angle([0, 0, 1], 0.2)), fov_y_rad: 1.1 });
    for (const point of [
      [0, 0, 9],
      [3, -2, 9],
      [-4, 1, 8],
    ] as Vec3[]) {
      expect_same_place(point, picture, view, Infinity);
    }
  });

  it('shows what an orbiting camera looks at where it is', () => {
    const picture = eye({ position: [0, 0, -5] });
    const view = eye({ position: [0.6, 0.2, -5.1], orientation: turn });
    // On the plane through the focus, five ahead of the view.
    const on_plane = (x: number, y: number): Vec3 =>
      add(view.position, rotate(view.orientation, [x, y, 5]));
    for (const [x, y] of [
      [0, 0],
      [1, 0.5],
      [-2, -1],
    ] as const) {
      expect_same_place(on_plane(x, y), picture, view, 5);
    }
  });

  it('shows all of an orthographic view where it is, whatever its depth and scale', () => {
    const picture = eye({ orientation: turn, view_height: 9 });
    const view = eye({ orientation: turn, position: [0.4, -0.3, 2], view_height: 6 });
    for (const point of [
      [0, 0, 9],
      [1, -2, 40],
    ] as Vec3[]) {
      expect_same_place(point, picture, view, Infinity);
    }
    expect(can_show(picture, view)).toBe(true);
    expect(can_show(picture, eye({ view_height: 6 }))).toBe(false); // from another side
    expect(can_show(picture, eye({ orientation: turn }))).toBe(false);
  });

  it('is the picture itself where nothing has moved', () => {
    const m = warp_matrix(eye(), eye(), aspect, Infinity);
    expect([...m]).toEqual([1, 0, 0, 0, 1, 0, 0, 0, 1]);
    expect(reach(m)).toEqual({ x: 1, y: 1 });
    expect(uncovered_share(m)).toBe(0);
  });

  it('tells how far the view goes beyond it', () => {
    const view = eye({ orientation: axis_angle(up, 0.1) });
    const plain = warp_matrix(eye(), view, aspect, Infinity);
    expect(reach(plain).x).toBeGreaterThan(1.05);
    expect(reach(plain).y).toBeLessThan(reach(plain).x);
    expect(uncovered_share(plain)).toBeGreaterThan(0.03);
    const wide = warp_matrix(eye({ fov_y_rad: widened_fov(1, 1.26) }), view, aspect, Infinity);
    expect(reach(wide).x).toBeLessThan(1);
    expect(uncovered_share(wide)).toBe(0);
    const behind = warp_matrix(eye(), eye({ orientation: axis_angle(up, 3) }), aspect, Infinity);
    expect(reach(behind)).toEqual({ x: 4, y: 4 });
    expect(uncovered_share(behind)).toBe(1);
  });
});

// tests/load/display_test.cpp holds the warp of catgs-load to the same numbers.
describe.each(golden.warps)('the warp: $name', (warp) => {
  const m = warp_matrix(
    warp.picture as unknown as Eye,
    warp.view as unknown as Eye,
    warp.picture_aspect,
    warp.distance ?? Infinity,
    warp.view_aspect,
  );

  it('is that of the shared numbers', () => {
    const close = (values: readonly number[]): unknown[] =>
      values.map((v): unknown => expect.closeTo(v, 5));
    expect([...m]).toEqual(close(warp.matrix));
    expect(warped(m, 1, -1) ?? null).toEqual(warp.corner && close(warp.corner));
    expect(Object.values(reach(m))).toEqual(close(warp.reach));
    expect(uncovered_share(m)).toBeCloseTo(warp.uncovered, 6);
  });
});

describe('the forecast of a turn', () => {
  const eye_at = (yaw: number): Eye => eye({ orientation: axis_angle(up, yaw) });
  /** A second at 60 Hz. */
  function turn(forecast: TurnForecast, rate: number, lag_s: number, from_s: number): number {
    for (let i = 1; i <= 60; ++i) {
      const s = from_s + i / 60;
      const sample = { pose_id: i, time_us: s * 1e6, eye: eye_at(rate * s), distance: Infinity };
      forecast.moved(sample);
      forecast.drawn(eye_at(rate * (s - lag_s)).orientation, s * 1e6);
    }
    return from_s + 1;
  }
  const ahead = (forecast: TurnForecast, rate: number, s: number): number =>
    angle_between(forecast.eye_later(s * 1e6)!.orientation, eye_at(rate * s).orientation);

  it('is the rate times the lag that pictures were seen to have', () => {
    const forecast = new TurnForecast();
    let s = turn(forecast, 1, 0.2, 0);
    expect(ahead(forecast, 1, s)).toBeCloseTo(0.2, 3);
    s = turn(forecast, 0.5, 0.2, s);
    expect(ahead(forecast, 0.5, s)).toBeCloseTo(0.1, 3);
  });

  it('is ready before a picture has come, and bounded', () => {
    const forecast = new TurnForecast();
    expect(forecast.eye_later(0)).toBeUndefined();
    forecast.moved({ pose_id: 1, time_us: 0, eye: eye_at(0), distance: Infinity });
    forecast.moved({ pose_id: 2, time_us: 20_000, eye: eye_at(0.02), distance: Infinity });
    expect(
      angle_between(forecast.eye_later(20_000)!.orientation, eye_at(0.02).orientation),
    ).toBeCloseTo(0.1, 3);
    const s = turn(forecast, 4, 3, 1);
    expect(ahead(forecast, 4, s)).toBeCloseTo(0.5, 3);
  });
});

describe('the policy of warping', () => {
  let now_us = 0;
  /** A second of motion at 60 Hz. */
  const move = (policy: WarpPolicy, x: number, draw_us = 500, seconds = 1, y = 1): boolean => {
    let changed = false;
    for (let i = 0; i < 60 * seconds; ++i) {
      now_us += 16_667;
      changed = policy.drawn({ x, y }, draw_us, now_us) || changed;
    }
    return changed;
  };

  it('asks for as much overscan as the motion needs, and no more', () => {
    const policy = new WarpPolicy(true);
    expect(policy.overscan).toEqual({ x: 1, y: 1 });
    expect(move(policy, 1.002)).toBe(false);
    expect(policy.overscan).toEqual({ x: 1, y: 1 });
    expect(move(policy, 1.2, 500, 3, 1.05)).toBe(true);
    expect(policy.overscan).toEqual({ x: 1.26, y: 1.12 });
    expect(move(policy, 1.01, 500, 8, 1.05)).toBe(false); // the height is still needed
    expect(move(policy, 1.01, 500, 8)).toBe(false);
    expect(move(policy, 1.01, 500, 8)).toBe(true);
    expect(policy.overscan).toEqual({ x: 1.12, y: 1 });
    move(policy, 3, 500, 3, 3);
    expect(policy.overscan).toEqual({ x: 1.6, y: 1.26 });
    expect(1.6 * 1.26).toBeLessThan(2.1); // pixels to draw over pixels of the view
  });

  it('is off where drawing takes too long, unless somebody wants it', () => {
    const policy = new WarpPolicy(true);
    move(policy, 1.12);
    expect(move(policy, 1.12, 15_000, 3)).toBe(true);
    expect(policy.active).toBe(false);
    expect(policy.overscan).toEqual({ x: 1, y: 1 });
    expect(policy.state).toBe('too_slow');
    policy.mode = 'on';
    expect(policy.active).toBe(true);
    expect(policy.overscan).toEqual({ x: 1.26, y: 1.12 });
    move(policy, 1.0, 15_000, 30);
    expect(policy.active).toBe(true);
    expect(policy.overscan).toEqual({ x: 1.26, y: 1.12 });
    policy.mode = 'off';
    expect(policy.active).toBe(false);
    expect(move(policy, 1.3, 500, 3)).toBe(false);
  });

  it('is off without WebGL2', () => {
    const policy = new WarpPolicy(false);
    policy.mode = 'on';
    expect(policy.active).toBe(false);
    expect(policy.overscan).toEqual({ x: 1, y: 1 });
  });
});

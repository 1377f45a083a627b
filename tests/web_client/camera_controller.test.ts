import { describe, expect, it } from 'vitest';
import {
  add,
  axis_angle,
  cross,
  dot,
  forward,
  identity,
  length,
  look_at,
  multiply,
  normalize,
  right,
  rotate,
  sub,
  type Quat,
  type Vec3,
} from '#client/base/vector';
import { same_view } from '#client/camera/same_view';
import { camera, expect_vec, gesture, hold, scene, view_of } from './cameras';

const down: Vec3 = [0, 1, 0];

describe('quaternions', () => {
  it('turn right-handed', () => {
    expect_vec(cross(right, down), forward);
    // A quarter turn about "up" (-y) takes forward to the left.
    expect_vec(rotate(axis_angle([0, -1, 0], Math.PI / 2), forward), [-1, 0, 0]);
    // A quarter turn about the camera's x axis takes forward to up.
    expect_vec(rotate(axis_angle(right, Math.PI / 2), forward), [0, -1, 0]);
  });

  it('multiply as rotations do: the right one first', () => {
    const a = axis_angle([0, -1, 0], 0.7);
    const b = axis_angle(right, -0.3);
    expect_vec(rotate(multiply(a, b), [1, 2, 3]), rotate(a, rotate(b, [1, 2, 3])));
  });
});

describe('flying', () => {
  it('keeps the scene under the pointer', () => {
    const made = camera('fly');
    // A drag of half a height to the right turns the view left by half the field of view.
    gesture(made, { kind: 'look', dx: 0.5, dy: 0 });
    const angle = made.fov_y_rad / 2;
    expect_vec(view_of(made), [-Math.sin(angle), 0, Math.cos(angle)]);
    expect_vec(made.pose.position, [0, 0, -5]);
  });

  it('looks up when dragged down, and never over the top', () => {
    const made = camera('fly');
    gesture(made, { kind: 'look', dx: 0, dy: 0.2 });
    expect(dot(view_of(made), scene.up)).toBeGreaterThan(0.1);
    gesture(made, { kind: 'look', dx: 0, dy: 50 });
    const elevation = Math.asin(dot(view_of(made), scene.up));
    expect(elevation).toBeCloseTo((88 * Math.PI) / 180, 6);
    expect(dot(rotate(made.pose.orientation, down), scene.up)).toBeLessThan(0);
  });

  it('moves along its axes, up and down along the world', () => {
    const made = camera('fly');
    hold(made, { forward: 1 });
    expect(made.pose.position[2]).toBeGreaterThan(-5);
    const fast = camera('fly');
    hold(fast, { forward: 1, fast: true });
    expect((fast.pose.position[2] + 5) / (made.pose.position[2] + 5)).toBeCloseTo(4, 5);
    const tilted = camera('fly');
    gesture(tilted, { kind: 'look', dx: 0, dy: 0.3 });
    hold(tilted, { up: 1 });
    expect_vec([tilted.pose.position[0], 0, tilted.pose.position[2]], [0, 0, -5]);
    expect(tilted.pose.position[1]).toBeLessThan(-0.1);
  });

  it('stays inside the limits', () => {
    const made = camera('fly');
    hold(made, { forward: -1, fast: true }, 30);
    expect(made.pose.position[2]).toBe(-20);
    hold(made, { right: 1, fast: true }, 30);
    expect(made.pose.position[0]).toBe(20);
  });
});

describe('orbiting', () => {
  it('goes around the focus and keeps looking at it', () => {
    const made = camera();
    gesture(made, { kind: 'look', dx: 0.5, dy: 0.1 });
    const to_focus = sub(scene.focus, made.pose.position);
    expect(length(to_focus)).toBeCloseTo(5, 6);
    expect(dot(to_focus, view_of(made))).toBeCloseTo(5, 6);
    // A drag to the right takes the camera to the left. A drag down takes it up.
    expect(made.pose.position[0]).toBeLessThan(-4);
    expect(made.pose.position[1]).toBeLessThan(0);
  });

  it('comes closer by the wheel, but not through the focus', () => {
    const made = camera();
    gesture(made, { kind: 'dolly', steps: 1 });
    expect(made.pose.position[2]).toBeCloseTo(-5 * 0.88, 6);
    gesture(made, { kind: 'dolly', steps: 500 });
    expect(made.pose.position[2]).toBeCloseTo(-scene.near_z * 1.5, 6);
    gesture(made, { kind: 'dolly', steps: -1 });
    expect(made.pose.position[2]).toBeLessThan(-scene.near_z * 1.5);
  });

  it('pans with the pointer and takes the focus along', () => {
    const made = camera();
    gesture(made, { kind: 'pan', dx: 0.5, dy: 0 });
    const half_height = 5 * Math.tan(made.fov_y_rad / 2);
    expect_vec(made.pose.position, [-half_height, 0, -5]);
    gesture(made, { kind: 'look', dx: 0.5, dy: 0 });
    expect(length(sub(made.pose.position, [-half_height, 0, 0]))).toBeCloseTo(5, 6);
  });

  it('stops at the limits instead of leaving its circle', () => {
    const made = camera('orbit', { limits_min: [-3, -20, -20], limits_max: [3, 20, 20] });
    for (let i = 0; i < 100; ++i) {
      gesture(made, { kind: 'look', dx: 0.01, dy: 0 });
    }
    expect(made.pose.position[0]).toBeGreaterThanOrEqual(-3);
    expect(length(made.pose.position)).toBeCloseTo(5, 6);
  });

  it('walks around by the arrow keys in their direction', () => {
    const made = camera();
    hold(made, { turn_right: 1 }, 0.5);
    expect(made.pose.position[0]).toBeGreaterThan(1);
    const above = camera();
    hold(above, { turn_up: 1 }, 0.5);
    expect(above.pose.position[1]).toBeLessThan(-1);
  });

  it('orbits what it looks at after a flight', () => {
    const made = camera('fly');
    gesture(made, { kind: 'look', dx: 0.6, dy: 0 });
    const ahead = view_of(made);
    made.set_mode('orbit');
    const before = made.pose.position;
    gesture(made, { kind: 'dolly', steps: 1 });
    const moved = sub(made.pose.position, before);
    expect(dot(moved, ahead)).toBeCloseTo(length(moved), 6);
    expect(length(moved)).toBeGreaterThan(0.1);
  });
});

describe('same view', () => {
  const at = scene.start_pose;

  it('holds through the rounding of the wire and for either sign of the quaternion', () => {
    const [x, y, z, w] = multiply(axis_angle(right, 0.3), axis_angle(forward, 1));
    const pose = { position: [100.1, -7.7, 3.3] as const, orientation: [x, y, z, w] as const };
    const rounded = {
      position: pose.position.map(Math.fround) as unknown as Vec3,
      orientation: [x, y, z, w].map((v) => -Math.fround(v)) as unknown as Quat,
    };
    expect(same_view(rounded, pose, { near_z: 0.2 })).toBe(true);
  });

  it('is as exact in a scene far from 0 as in one near it', () => {
    const origin: Vec3 = [500123, 5412345, 431];
    const far = { ...at, position: add(at.position, origin) };
    const moved = { ...far, position: add(far.position, [0, 1e-4, 0]) };
    expect(same_view(far, far, { near_z: 0.2, origin })).toBe(true);
    expect(same_view(moved, far, { near_z: 0.2, origin })).toBe(false);
  });

  it('ends where a movement can be seen', () => {
    const turned = { ...at, orientation: axis_angle(right, 1e-4) };
    const moved = { ...at, position: [0, 1e-4, -5] as const };
    expect(same_view(turned, at, { near_z: 0.2 })).toBe(false);
    expect(same_view(moved, at, { near_z: 0.2 })).toBe(false);
  });
});

describe('any mode', () => {
  it('glides after a gesture, by the same amount, and comes to rest', () => {
    const glide = camera('fly');
    glide.smoothing_s = 0.05;
    glide.gesture({ kind: 'look', dx: 0.5, dy: 0 });
    expect(glide.step(0.016)).toBe(true);
    const early = Math.acos(view_of(glide)[2]);
    for (let i = 0; i < 120 && !glide.at_rest; ++i) glide.step(0.016);
    expect(glide.at_rest).toBe(true);
    expect(early).toBeLessThan(glide.fov_y_rad / 2);
    expect(Math.acos(view_of(glide)[2])).toBeCloseTo(glide.fov_y_rad / 2, 5);
    expect(glide.step(0.016)).toBe(false);
  });

  it('does not move without cause', () => {
    const made = camera();
    expect(made.step(0.016)).toBe(false);
    expect(made.pose).toBe(made.pose);
  });

  it('levels a tilted start pose while turning', () => {
    const tilted: Quat = axis_angle(forward, 0.4);
    const made = camera('fly', { start_pose: { position: [0, 0, -5], orientation: tilted } });
    expect(made.step(0.016)).toBe(false); // not by itself
    for (let i = 0; i < 200; ++i) {
      gesture(made, { kind: 'look', dx: 0.002, dy: 0 });
    }
    expect(dot(rotate(made.pose.orientation, right), scene.up)).toBeCloseTo(0, 3);
  });

  it('goes as fast as the scene is large, wherever visits begin', () => {
    const way = (start_z: number): number => {
      const made = camera('fly', {
        scale: 4,
        start_pose: { position: [0, 0, start_z], orientation: identity },
      });
      hold(made, { forward: 1 }, 0.1);
      return made.pose.position[2] - start_z;
    };
    expect(way(-5)).toBeCloseTo(0.24, 6);
    expect(way(-0.1)).toBeCloseTo(way(-5), 6);
  });

  it('judges the scale by the start where the server does not tell it', () => {
    expect(camera('fly', { scale: 0 }).reach).toBe(5);
  });

  it('goes by the speed that the visitor chose, within bounds', () => {
    const made = camera('fly');
    made.speed = 2;
    hold(made, { forward: 1 }, 0.1);
    expect(made.pose.position[2]).toBeCloseTo(-4.4, 6);
    made.speed = 1e9;
    expect(made.speed).toBe(16);
    made.speed = 0;
    expect(made.speed).toBe(1 / 16);
  });

  it("knows the scene's own field of view, whatever the visitor has chosen", () => {
    const made = camera('fly');
    for (const [chosen, own] of [
      [1.5, Math.PI / 3],
      [0.5, 0.9],
    ] as const) {
      if (own === 0.9) made.start_at({ ...made.eye, fov_y_rad: own });
      made.fov_y_rad = chosen;
      expect(made.start_fov_y_rad).toBeCloseTo(own, 9);
      expect(made.start!.fov_y_rad).toBeCloseTo(own, 9);
      expect(made.fov_y_rad).toBe(chosen);
      made.reset();
      expect(made.fov_y_rad).toBeCloseTo(own, 9);
    }
  });

  it('turns a scene that lies on its side, and its start', () => {
    const made = camera('fly');
    made.turn_up(Math.PI / 2);
    expect_vec(made.up, [1, 0, 0]);
    expect_vec(rotate(made.pose.orientation, down), [-1, 0, 0]);
    expect_vec(view_of(made), forward);
    made.reset();
    expect_vec(made.up, [1, 0, 0]);
    expect_vec(rotate(made.pose.orientation, down), [-1, 0, 0]);
    expect_vec(made.scene!.up, [1, 0, 0]);
  });

  it('stands on a wall that it looks at', () => {
    const made = camera('orbit');
    made.stand_on([0, 0, 3], [0, 0, -1], true);
    made.step(0.016);
    expect_vec(made.up, [0, 0, -1]);
    expect(dot(sub(made.pose.position, [0, 0, 3]), made.up)).toBeCloseTo(4, 6);
    expect(length(sub(made.pose.position, [0, 0, 3]))).toBeCloseTo(8, 6);
    expect_vec(view_of(made), normalize(sub([0, 0, 3], made.pose.position), forward));
    expect(dot(rotate(made.pose.orientation, right), made.up)).toBeCloseTo(0, 6);
    gesture(made, { kind: 'look', dx: 0.1, dy: 0 });
    expect(length(sub(made.pose.position, [0, 0, 3]))).toBeCloseTo(8, 5);
  });

  it('flips up and down in place', () => {
    const made = camera('fly');
    made.turn_over();
    expect_vec(view_of(made), forward);
    expect_vec(rotate(made.pose.orientation, down), [0, -1, 0]);
    expect_vec(made.pose.position, scene.start_pose.position);
    hold(made, { up: 1 });
    expect(made.pose.position[1]).toBeGreaterThan(0.1);
  });

  it('flips a scene that it sees from above, and sees it from above', () => {
    const position: Vec3 = [0, -2, -2];
    const start_pose = { position, orientation: look_at(position, [0, 0, 0], [0, -1, 0]) };
    const made = camera('orbit', { start_pose, focus: [0, 0, 0] });
    const expect_flipped = (): void => {
      expect_vec(made.up, [0, 1, 0]);
      expect_vec(made.pose.position, [0, 2, -2]);
      expect_vec(view_of(made), normalize([0, -1, 1], forward));
      expect(dot(rotate(made.pose.orientation, down), made.up)).toBeLessThan(0);
      expect(dot(rotate(made.pose.orientation, right), made.up)).toBeCloseTo(0, 6);
    };
    made.turn_over();
    expect_flipped();
    gesture(made, { kind: 'look', dx: 0.3, dy: 0 });
    made.reset();
    expect_flipped();
    expect_vec(made.scene!.up, [0, 1, 0]);
    made.turn_over();
    expect_vec(made.up, [0, -1, 0]);
    expect_vec(made.pose.position, position);
  });

  it('returns to the start', () => {
    const made = camera('fly');
    hold(made, { forward: 1, turn_right: 1 });
    made.fov_y_rad = 2;
    made.reset();
    expect(made.pose).toEqual(scene.start_pose);
    expect(made.fov_y_rad).toBeCloseTo(Math.PI / 3, 9);
  });

  it('knows no limits when the scene has none', () => {
    const made = camera('fly', { limits_min: [0, 0, 0], limits_max: [0, 0, 0] });
    hold(made, { forward: -1, fast: true }, 30);
    expect(made.pose.position[2]).toBeLessThan(-100);
  });
});

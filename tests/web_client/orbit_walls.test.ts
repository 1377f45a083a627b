// An orbiting camera and what is opaque around it.
import { describe, expect, it } from 'vitest';
import type { Vec3 } from '#client/base/vector';
import type { CameraController } from '#client/camera/camera_controller';
import { no_axes, type Axes } from '#client/camera/movement';
import type { Ray } from '#client/camera/ray';
import { camera, view_of } from './cameras';

const hall: Vec3 = [4, 3, 40]; // half its sides
const leeway = 0.005 * 33; // rays pass so far beside, and surfaces are no thicker

/** The distance to the wall of a box around 0; Infinity: the ray starts outside of it, and leads away. */
function wall_along(half: Vec3, { origin, direction }: Ray): number {
  let [enter, leave] = [-Infinity, Infinity];
  for (let k = 0; k < 3; ++k) {
    const a = (-half[k]! - origin[k]!) / direction[k]!;
    const b = (half[k]! - origin[k]!) / direction[k]!;
    if (Number.isNaN(a)) continue;
    enter = Math.max(enter, Math.min(a, b));
    leave = Math.min(leave, Math.max(a, b));
  }
  if (enter > leave || leave < 0) return Infinity;
  return enter > 0 ? enter : leave;
}

interface Move {
  readonly drag?: readonly [number, number];
  readonly axes?: Partial<Axes>;
  readonly wheel?: number;
}

const moves: readonly Move[] = [
  { drag: [0.17, 0] },
  { drag: [-0.5, 0.4] },
  { axes: { turn_right: 1 } },
  { axes: { turn_up: -1, turn_right: -1 } },
  { axes: { right: 1, fast: true } },
  { axes: { up: 1 } },
  { wheel: -9 },
];

/** Two seconds of it. Returns where the camera was. */
async function play(made: CameraController, { drag, axes, wheel }: Move): Promise<Vec3[]> {
  const way: Vec3[] = [];
  for (let k = 0; k < 120; ++k) {
    if (drag && k < 30) made.gesture({ kind: 'look', dx: drag[0] / 30, dy: drag[1] / 30 });
    if (wheel && k < 30) made.gesture({ kind: 'dolly', steps: wheel / 30 });
    made.step(1 / 60, { ...no_axes, ...axes });
    way.push(made.pose.position);
    await Promise.resolve();
    await new Promise((resolve) => setImmediate(resolve));
  }
  return way;
}

const is_inside = (half: Vec3, at: Vec3): boolean =>
  at.every((v, k) => Math.abs(v) < half[k]! + leeway);

describe('an orbiting camera in a hall', () => {
  const start: Vec3 = [1, 0, -33];
  const in_hall = (): CameraController =>
    camera('orbit', {
      start_pose: { position: start, orientation: [0, 0, 0, 1] },
      focus: [1, 0, 0],
      limits_min: [-90, -90, -90],
      limits_max: [90, 90, 90],
      enclosed: true,
    });

  it.each(moves)('passes no wall by %j, and still turns', async (move) => {
    const made = in_hall();
    made.asks_distance = (ray) => Promise.resolve(wall_along(hall, ray));
    const view = view_of(made);
    for (const at of await play(made, move)) expect(is_inside(hall, at)).toBe(true);
    if (move.drag ?? move.axes?.turn_right) expect(view_of(made)).not.toEqual(view);
  });

  it.each(moves)('passes no wall by %j that rays from within it do not meet', async (move) => {
    const made = in_hall();
    made.asks_distance = (ray) => {
      const distance = wall_along(hall, ray);
      return Promise.resolve(distance < 0.4 ? Infinity : distance);
    };
    for (const at of await play(made, move)) expect(is_inside(hall, at)).toBe(true);
  });

  it.each(moves)('stays by %j where no server answers', async (move) => {
    const made = in_hall();
    made.asks_distance = () => Promise.resolve(undefined);
    for (const at of await play(made, move)) expect(at).toEqual(start);
  });
});

describe('an orbiting camera outside', () => {
  const post: Vec3 = [0.5, 3, 0.5];
  const around = (half: Vec3): CameraController => {
    const made = camera('orbit');
    made.asks_distance = async (ray) => {
      for (let k = 0; k < 3; ++k) await new Promise((resolve) => setImmediate(resolve));
      return wall_along(half, { ...ray, origin: [ray.origin[0] + 4, 0, ray.origin[2] + 3] });
    };
    return made;
  };

  it('circles where nothing is in the way', async () => {
    const made = around([0.1, 0.1, 0.1]);
    await play(made, { drag: [-0.2, 0] });
    expect(made.pose.position[0]).toBeCloseTo(5 * Math.sin(0.2 * Math.PI), 3);
    expect(made.pose.position[2]).toBeCloseTo(-5 * Math.cos(0.2 * Math.PI), 3);
  });

  it('comes back from what it has met before the answer came', async () => {
    const made = around(post); // at x = -4, z = -3, on the circle
    await play(made, { drag: [0.5, 0] });
    expect(made.pose.position[0]).toBeGreaterThan(-3.6);
  });

  it('goes anywhere where no server answers', async () => {
    const made = around(post);
    made.asks_distance = () => Promise.reject(new Error('away'));
    await play(made, { drag: [0.5, 0] });
    expect(made.pose.position[0]).toBeLessThan(-4.9);
  });
});

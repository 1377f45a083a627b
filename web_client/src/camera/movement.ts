// What pointers, wheels, keys and sticks ask of a camera.
import { clamp } from '../base/vector';

/** One movement of a pointer or wheel. Distances are fractions of the view's height, y down. */
export type Gesture =
  | { kind: 'look'; dx: number; dy: number } // the scene follows the pointer
  | { kind: 'pan'; dx: number; dy: number } // the scene follows the pointer
  | { kind: 'dolly'; steps: number }; // > 0: towards the scene; 1 = one notch of a wheel

const directions = ['right', 'up', 'forward', 'turn_right', 'turn_up'] as const;

/** Held keys and deflected sticks, each -1…1. */
export type Axes = Readonly<Record<(typeof directions)[number], number>> & {
  readonly fast: boolean;
};

export const no_axes: Axes = {
  right: 0,
  up: 0,
  forward: 0,
  turn_right: 0,
  turn_up: 0,
  fast: false,
};

/** Whether a key or a stick moves the camera. */
export const is_held = (axes: Axes): boolean =>
  directions.some((direction) => axes[direction] !== 0);

/** All of these keys and sticks together. */
export function sum_of(...held: readonly Partial<Axes>[]): Axes {
  const sum = { ...no_axes, fast: held.some(({ fast }) => fast) };
  for (const direction of directions) {
    const total = held.reduce((so_far, axes) => so_far + (axes[direction] ?? 0), 0);
    sum[direction] = clamp(total, -1, 1);
  }
  return sum;
}

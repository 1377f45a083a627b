// What pointers, wheels, keys and sticks ask of a camera.

/** One movement of a pointer or wheel. Distances are fractions of the view's height, y down. */
export type Gesture =
  | { kind: 'look'; dx: number; dy: number } // the scene follows the pointer
  | { kind: 'pan'; dx: number; dy: number } // the scene follows the pointer
  | { kind: 'dolly'; steps: number }; // > 0: towards the scene; 1 = one notch of a wheel

/** Held keys and deflected sticks, each -1…1. */
export interface Axes {
  readonly right: number;
  readonly up: number;
  readonly forward: number;
  readonly turn_right: number;
  readonly turn_up: number;
  readonly fast: boolean;
}

export const no_axes: Axes = {
  right: 0,
  up: 0,
  forward: 0,
  turn_right: 0,
  turn_up: 0,
  fast: false,
};

/** Whether a key or a stick moves the camera. */
export function is_held(axes: Axes): boolean {
  return (
    axes.right !== 0 ||
    axes.up !== 0 ||
    axes.forward !== 0 ||
    axes.turn_right !== 0 ||
    axes.turn_up !== 0
  );
}

/** Keys and sticks together. */
export function sum_of(a: Axes, b: Axes): Axes {
  const clamped = (v: number): number => Math.min(1, Math.max(-1, v));
  return {
    right: clamped(a.right + b.right),
    up: clamped(a.up + b.up),
    forward: clamped(a.forward + b.forward),
    turn_right: clamped(a.turn_right + b.turn_right),
    turn_up: clamped(a.turn_up + b.turn_up),
    fast: a.fast || b.fast,
  };
}

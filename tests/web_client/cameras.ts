// A camera in a small scene, and what tests do with it.
import { expect } from 'vitest';
import { forward, identity, rotate, type Vec3 } from '#client/base/vector';
import { CameraController } from '#client/camera/camera_controller';
import type { CameraMode } from '#client/camera/mode';
import { no_axes, type Axes, type Gesture } from '#client/camera/movement';
import type { SceneSetup } from '#client/camera/scene_setup';

export const scene: SceneSetup = {
  up: [0, -1, 0],
  start_pose: { position: [0, 0, -5], orientation: identity },
  focus: [0, 0, 0],
  limits_min: [-20, -20, -20],
  limits_max: [20, 20, 20],
  near_z: 0.2,
  scale: 5,
};

/** A camera that moves at once. */
export function camera(
  mode: CameraMode = 'orbit',
  change: Partial<SceneSetup> = {},
): CameraController {
  const made = new CameraController();
  made.smoothing_s = 0;
  made.load({ ...scene, ...change });
  made.set_mode(mode);
  return made;
}

export function hold(made: CameraController, axes: Partial<Axes>, seconds = 1): void {
  for (let i = 0; i < 60; ++i) made.step(seconds / 60, { ...no_axes, ...axes });
}

export function gesture(made: CameraController, what: Gesture): void {
  made.gesture(what);
  made.step(0.016);
}

export const view_of = (made: CameraController): Vec3 => rotate(made.pose.orientation, forward);

export function expect_vec(
  actual: readonly number[],
  expected: readonly number[],
  digits = 5,
): void {
  expect(actual).toHaveLength(expected.length);
  actual.forEach((v, i) => expect(v).toBeCloseTo(expected[i]!, digits));
}

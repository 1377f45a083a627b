// A headset that Chromium believes in: the emulator `iwer`, which tests move.
import { readFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import type { Page } from 'playwright-core';
import { expect } from 'vitest';
import { rotate, sub, look_at, type Quat, type Vec3 } from '#client/base/vector';
import type { Pose } from '#client/camera/eye';

interface Place {
  set(...values: number[]): void;
}
interface Tracked {
  readonly position: Place;
  readonly quaternion: Place;
  connected: boolean;
}
interface Controller extends Tracked {
  updateButtonValue(id: string, value: number): void;
  updateAxes(id: string, x: number, y: number): void;
}
interface Hand extends Tracked {
  updatePinchValue(value: number): void;
}
interface Emulated extends Tracked {
  readonly controllers: Readonly<Record<'left' | 'right', Controller>>;
  readonly hands: Readonly<Record<'left' | 'right', Hand>>;
  primaryInputMode: 'controller' | 'hand';
  readonly activeSession:
    | { end(): Promise<void>; requestAnimationFrame(refreshed: () => void): void }
    | undefined;
  recenter(): void;
  updateVisibilityState(state: 'visible' | 'visible-blurred' | 'hidden'): void;
}

declare global {
  interface Window {
    emulated?: Emulated;
  }
}

export const eyes_m = 1.6; // over the floor, as the emulator begins
export const between_eyes_m = 0.064;

/** A script for pages, before their own: it puts a Quest 3 on the visitor, whose eyes see 90 degrees each way. */
export const with_headset = `${readFileSync(
  createRequire(import.meta.url).resolve('iwer/build/iwer.js'),
  'utf8',
)};
window.emulated = new IWER.XRDevice(IWER.metaQuest3, { ipd: ${between_eyes_m}, stereoEnabled: true });
window.emulated.installRuntime({ forceInstall: true }); // Chromium has a runtime, but no headset
for (const side of ['left', 'right']) window.emulated.controllers[side].connected = false;`;

/** Enters by the button of the page. */
export async function enter(page: Page): Promise<void> {
  await page.getByRole('button', { name: 'Enter VR' }).click();
  await expect
    .poll(() => page.evaluate(async () => (await window.catgs!.stats()).headset_hz !== undefined))
    .toBe(true);
}

/** Waits for some refreshes of the headset. */
export const refreshes = (page: Page, count = 4): Promise<void> =>
  page.evaluate(
    (n) =>
      new Promise((resolve) => {
        const next = (left: number): void => {
          if (left === 0) resolve();
          else requestAnimationFrame(() => next(left - 1));
        };
        next(n);
      }),
    count,
  );

/** WebXR has y up and looks along -z; rooms have the axes of cameras. */
const in_webxr = ({ position: [x, y, z], orientation: [a, b, c, w] }: Pose) =>
  [
    [x, -y, -z],
    [a, -b, -c, w],
  ] as const;

type Part = 'head' | 'left' | 'right' | 'left hand' | 'right hand';

/** Puts a part of the visitor there in the room: metres, y down, z ahead, and the floor at 0. */
export async function put(page: Page, part: Part, pose: Pose): Promise<void> {
  const [position, orientation] = in_webxr(pose);
  await page.evaluate(
    ([name, at, turned]) => {
      const { emulated } = window;
      if (!emulated) throw new Error('there is no emulated headset');
      const [side, is_hand] = name.split(' ') as ['left' | 'right', string | undefined];
      const tracked =
        name === 'head' ? emulated : (is_hand ? emulated.hands : emulated.controllers)[side];
      tracked.connected = true;
      tracked.position.set(...at);
      tracked.quaternion.set(...turned);
    },
    [part, position, orientation] as const,
  );
  await refreshes(page);
}

export const level: Quat = [0, 0, 0, 1];
export const standing: Pose = { position: [0, -eyes_m, 0], orientation: level };

/** At `from`, pointing at `to`, both in the room. */
export const pointing = (from: Vec3, to: Vec3): Pose => ({
  position: from,
  orientation: look_at(from, to, [0, -1, 0]),
});

export async function push_stick(
  page: Page,
  side: 'left' | 'right',
  x: number,
  y: number,
): Promise<void> {
  await page.evaluate(
    ([hand, right, back]) =>
      window.emulated!.controllers[hand].updateAxes('thumbstick', right, back),
    [side, x, y] as const,
  );
  await refreshes(page);
}

/** Of the right controller, or a pinch of that hand: 1 is all the way. */
export async function pull_trigger(page: Page, value: number, with_hand = false): Promise<void> {
  await page.evaluate(
    ([v, hand]) => {
      const { controllers, hands } = window.emulated!;
      if (hand) hands.right.updatePinchValue(v);
      else controllers.right.updateButtonValue('trigger', v);
    },
    [value, with_hand] as const,
  );
  await refreshes(page);
}

/** Pulls the trigger, or pinches, and lets go. */
export async function press(page: Page, with_hand = false): Promise<void> {
  await pull_trigger(page, 1, with_hand);
  await pull_trigger(page, 0, with_hand);
}

/** Where a point of the world is in the room of a visitor whose head is there in both. */
export function in_room(point: Vec3, head_in_world: Pose, head_in_room: Pose, per_metre = 1): Vec3 {
  const q = head_in_world.orientation;
  const seen = rotate([-q[0], -q[1], -q[2], q[3]], sub(point, head_in_world.position));
  const [x, y, z] = rotate(head_in_room.orientation, seen);
  const at = head_in_room.position;
  return [at[0] + x / per_metre, at[1] + y / per_metre, at[2] + z / per_metre];
}

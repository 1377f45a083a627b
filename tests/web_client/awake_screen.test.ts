import { afterEach, beforeEach, expect, it, vi } from 'vitest';
import { AwakeScreen } from '#client/ui/awake_screen';

let held: number; // locks that nobody has released
let refuses: boolean;

beforeEach(() => {
  held = 0;
  refuses = false;
  vi.stubGlobal('document', Object.assign(new EventTarget(), { hidden: false }));
  vi.stubGlobal('navigator', {
    wakeLock: {
      request: () => {
        if (refuses) return Promise.reject(new DOMException('low battery', 'NotAllowedError'));
        held += 1;
        return Promise.resolve({ release: () => Promise.resolve((held -= 1)) });
      },
    },
  });
});

afterEach(() => void vi.unstubAllGlobals());

const settle = (): Promise<void> => new Promise((resolve) => setTimeout(resolve));

function hide(hidden: boolean): void {
  Object.assign(document, { hidden });
  if (hidden) held = 0; // browsers release it
  document.dispatchEvent(new Event('visibilitychange'));
}

it('stays on while a tour plays or somebody else leads, and no longer', async () => {
  const screen = new AwakeScreen();
  screen.watch('tour', true);
  screen.watch('leader', true);
  screen.watch('tour', true);
  await settle();
  expect(held).toBe(1);
  screen.watch('tour', false);
  await settle();
  expect(held).toBe(1);
  screen.watch('leader', false);
  await settle();
  expect(held).toBe(0);
});

it('stays on again when the page is seen again', async () => {
  const screen = new AwakeScreen();
  screen.watch('tour', true);
  hide(true);
  await settle();
  expect(held).toBe(0);
  hide(false);
  await settle();
  expect(held).toBe(1);
});

it('goes off where the browser refuses, or cannot keep it on', async () => {
  refuses = true;
  new AwakeScreen().watch('tour', true);
  await settle();
  vi.stubGlobal('navigator', {});
  new AwakeScreen().watch('tour', true);
  await settle();
  expect(held).toBe(0);
});

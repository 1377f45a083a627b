import { afterEach, beforeEach, describe, expect, it, vi } from 'vitest';
import { is_held, no_axes } from '#client/camera/movement';
import { Gamepads, type GamepadAction } from '#client/input/gamepad';

interface Pad {
  index: number;
  connected: boolean;
  mapping: string;
  axes: number[];
  buttons: { value: number; pressed: boolean }[];
}

let pads: (Pad | null)[];
let heard: GamepadAction[];
let gamepads: Gamepads;

beforeEach(() => {
  vi.useFakeTimers();
  vi.stubGlobal('window', new EventTarget());
  vi.stubGlobal('document', { hidden: false });
  vi.stubGlobal('navigator', { getGamepads: () => pads });
  pads = [];
  heard = [];
  gamepads = new Gamepads({ moved: () => undefined, action: (action) => heard.push(action) });
});

afterEach(() => {
  vi.useRealTimers();
  vi.unstubAllGlobals();
});

function plug_in(axes: number[], mapping = 'standard'): Pad {
  const buttons = Array.from({ length: 17 }, () => ({ value: 0, pressed: false }));
  const pad = { index: pads.length, connected: true, mapping, axes, buttons };
  pads.push(pad);
  window.dispatchEvent(new Event('gamepadconnected'));
  gamepads.axes();
  return pad;
}

function press(pad: Pad, ...indices: number[]): void {
  pad.buttons = pad.buttons.map((_, i) => {
    const pressed = indices.includes(i);
    return { value: Number(pressed), pressed };
  });
}

/** What it says after this time, in which the page reads it as often as it does. */
function after(ms: number): ReturnType<Gamepads['axes']> {
  for (let passed = 0; passed < ms; passed += 100) {
    vi.advanceTimersByTime(100);
    gamepads.axes();
  }
  return gamepads.axes();
}

describe('a controller', () => {
  it('moves by the left stick and triggers, and looks by the right stick', () => {
    const pad = plug_in([0, 0, 0, 0]);
    pad.axes = [1, -1, 1, -1];
    press(pad, 7, 5);
    expect(gamepads.axes()).toEqual({
      right: 1,
      forward: 1,
      turn_right: 1,
      turn_up: 1,
      up: 1,
      fast: true,
    });
    pad.axes = [0, 0.5, 0, 0];
    expect(gamepads.axes().forward).toBeLessThan(-0.1);
  });

  it.each([
    ['beside the middle', [0.2, -0.2, 0.34, 0.1]],
    ['about in the middle', [0.1, -0.1, 0.14, 0]],
  ])('whose sticks rest %s moves nothing, and all that they are pushed', (_name, rest) => {
    const pad = plug_in(rest);
    expect(is_held(gamepads.axes())).toBe(false);
    pad.axes = [1, ...rest.slice(1)];
    expect(gamepads.axes()).toMatchObject({ right: expect.closeTo(1, 0) as number, turn_right: 0 });
    pad.axes = rest;
    expect(is_held(after(5000))).toBe(false);
  });

  it('whose stick wears out meanwhile comes to rest, and one that is held goes on', () => {
    const pad = plug_in([0, 0, 0, 0]);
    pad.axes = [0.25, 0, 0, 0];
    expect(gamepads.axes().right).toBeGreaterThan(0);
    expect(is_held(after(3000))).toBe(false);
    pad.axes = [0.25, -1, 0, 0];
    expect(after(60_000).forward).toBe(1);
  });

  it.each([
    ['triggers that rest at one end', [0, 0, -1, 0, 0, -1]],
    ['a pedal', [0, 1, 0, 0, 0, 0]],
  ])('without the standard layout turns nobody by %s', (_name, rest) => {
    const pad = plug_in(rest, '');
    expect(is_held(after(1000))).toBe(false);
    press(pad, 5, 6, 7, 9);
    expect([is_held(after(100)), heard]).toEqual([false, []]);
    pad.axes = [-1, ...rest.slice(1)];
    press(pad, 0);
    expect(after(100).right).toBe(-1);
    expect(heard).toEqual(['next']);
  });

  it('without the standard layout, which reports an axis at its end once it is touched, stops', () => {
    const pad = plug_in([0, 0], '');
    pad.axes = [0, 1];
    expect(is_held(after(1000))).toBe(true);
    expect(is_held(after(10_000))).toBe(false);
  });

  it('that is used counts, whichever came first', () => {
    plug_in([0, 0, 0, 0]);
    pads.push(null);
    const second = plug_in([0, 0, 0, 0]);
    second.axes = [0, -1, 0, 0];
    press(second, 9);
    expect(after(100).forward).toBe(1);
    press(second);
    after(100);
    press(pads[0]!, 9);
    after(100);
    expect(heard).toEqual(['play', 'play']);
    second.connected = false;
    window.dispatchEvent(new Event('gamepaddisconnected'));
    expect(gamepads.axes()).toEqual(no_axes);
  });

  it('is not read while the page is hidden: nobody tells of what is let go', () => {
    const pad = plug_in([0, 0, 0, 0]);
    pad.axes = [0, -1, 0, 0];
    vi.stubGlobal('document', { hidden: true });
    expect(gamepads.axes()).toEqual(no_axes);
  });
});

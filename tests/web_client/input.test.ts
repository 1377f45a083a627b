import { describe, expect, it } from 'vitest';
import { no_axes } from '#client/camera/movement';
import { letter_of, position_of } from '#client/input/key';
import { HeldKeys } from '#client/input/keyboard';
import { Pointers, wheel_steps, type PointerSample } from '#client/input/pointers';

const height_px = 400;

/** Pointers that are down. */
function held(...samples: PointerSample[]): Pointers {
  const pointers = new Pointers();
  for (const one of samples) pointers.down(one);
  return pointers;
}

const sample = (change: Partial<PointerSample>): PointerSample => ({
  id: 1,
  type: 'mouse',
  x: 100,
  y: 100,
  buttons: 1,
  shift: false,
  primary: false,
  ...change,
});

describe('keys', () => {
  it('become axes, opposites cancel, unknown keys are left to the page', () => {
    const keys = new HeldKeys();
    expect(keys.down('KeyW', false)).toBe(true);
    expect(keys.down('KeyD', true)).toBe(true);
    expect(keys.down('Tab', true)).toBe(false);
    expect(keys.axes()).toEqual({ ...no_axes, forward: 1, right: 1, fast: true });
    keys.down('KeyS', false);
    expect(keys.axes()).toEqual({ ...no_axes, right: 1 });
    for (let step = 0; step < 5; ++step) keys.axes();
    keys.up('KeyD', false);
    keys.up('KeyW', false);
    expect(keys.axes()).toEqual({ ...no_axes, forward: -1 });
  });

  it('move the camera for some steps, however short the tap was and however late the scene', () => {
    const keys = new HeldKeys();
    keys.down('KeyW', false);
    keys.up('KeyW', false);
    for (let step = 0; step < 5; ++step) expect(keys.axes().forward).toBe(1);
    expect(keys.axes()).toEqual(no_axes);
    keys.down('KeyW', false);
    keys.up('KeyW', false);
    keys.down('KeyW', false); // and stays down
    for (let step = 0; step < 20; ++step) expect(keys.axes().forward).toBe(1);
    keys.up('KeyW', false);
    expect(keys.axes()).toEqual(no_axes);
  });

  it.each([
    // The layout, what the event says, the letter of the help, the position.
    ['English', { code: 'KeyM', key: 'm' }, 'M', 'KeyM'],
    ['capitals', { code: 'KeyM', key: 'M' }, 'M', 'KeyM'],
    ['French', { code: 'Semicolon', key: 'm' }, 'M', 'Semicolon'],
    ['French, another key', { code: 'KeyM', key: ',' }, ',', 'KeyM'],
    ['French, forward', { code: 'KeyW', key: 'z' }, 'Z', 'KeyW'],
    ['Dvorak', { code: 'KeyO', key: 'r' }, 'R', 'KeyO'],
    ['Russian', { code: 'KeyM', key: 'ь' }, 'M', 'KeyM'],
    ['Japanese input', { code: 'KeyM', key: 'Process' }, 'M', 'KeyM'],
    ['a tool without positions', { code: '', key: 'w' }, 'W', 'KeyW'],
    ['a remote control', { code: 'Unidentified', key: 'PageDown' }, 'PageDown', 'PageDown'],
    ['a remote control, space', { code: '', key: ' ' }, ' ', 'Space'],
    ['Escape', { code: 'Escape', key: 'Escape' }, 'Escape', 'Escape'],
  ])('have a letter and a position: %s', (_layout, event, letter, position) => {
    expect([letter_of(event), position_of(event)]).toEqual([letter, position]);
  });

  it('are released when the page loses the keyboard', () => {
    const keys = new HeldKeys();
    keys.down('ArrowLeft', true);
    keys.release_all();
    expect(keys.axes()).toEqual(no_axes);
  });
});

describe('mouse', () => {
  it('looks with the primary button, in fractions of the height', () => {
    const pointers = held(sample({}));
    expect(pointers.move(sample({ x: 140, y: 80 }), height_px)).toEqual([
      { kind: 'look', dx: 0.1, dy: -0.05 },
    ]);
  });

  it.each([
    ['the right button', { buttons: 2 }],
    ['the middle button', { buttons: 4 }],
    ['shift', { shift: true }],
  ])('pans with %s', (_name, change) => {
    const pointers = held(sample(change));
    expect(pointers.move(sample({ ...change, x: 120 }), height_px)).toEqual([
      { kind: 'pan', dx: 0.05, dy: 0 },
    ]);
  });

  it('does nothing while no button is held', () => {
    const pointers = new Pointers();
    expect(pointers.move(sample({ buttons: 0 }), height_px)).toEqual([]);
    pointers.down(sample({}));
    pointers.up(1);
    expect(pointers.move(sample({ x: 300 }), height_px)).toEqual([]);
  });

  it('zooms by the wheel, whatever its unit, and by the pinch of a trackpad', () => {
    expect(wheel_steps(-100, 0, false)).toBe(1);
    expect(wheel_steps(3, 1, false)).toBe(-0.99);
    expect(wheel_steps(-1e6, 2, false)).toBe(8);
    expect(wheel_steps(-5, 0, true)).toBe(0.4);
    expect(wheel_steps(-100, 0, true)).toBe(1); // a wheel while Ctrl is held
  });
});

describe('touch', () => {
  const finger = (id: number, x: number, y: number): PointerSample =>
    sample({ id, type: 'touch', x, y });

  it('looks with one finger', () => {
    const pointers = held(finger(1, 10, 10));
    expect(pointers.move(finger(1, 10, 50), height_px)).toEqual([{ kind: 'look', dx: 0, dy: 0.1 }]);
  });

  it('pans with two fingers by their mean', () => {
    const pointers = held(finger(1, 100, 100), finger(2, 200, 100));
    const moves = [
      ...pointers.move(finger(1, 140, 100), height_px),
      ...pointers.move(finger(2, 240, 100), height_px),
    ];
    const pan = moves.filter((gesture) => gesture.kind === 'pan');
    expect(pan.reduce((sum, { dx }) => sum + dx, 0)).toBeCloseTo(0.1, 9);
    const dolly = moves.filter((gesture) => gesture.kind === 'dolly');
    expect(dolly.reduce((sum, { steps }) => sum + steps, 0)).toBeCloseTo(0, 9);
  });

  it('pinches: spreading comes closer', () => {
    const pointers = held(finger(1, 100, 100), finger(2, 200, 100));
    const moves = pointers.move(finger(2, 213, 100), height_px);
    const dolly = moves.find((gesture) => gesture.kind === 'dolly');
    expect(dolly?.steps).toBeCloseTo(1, 9);
  });

  it('forgets fingers whose end was lost when a first one comes, and all at once', () => {
    const pointers = held(finger(1, 100, 100), finger(2, 200, 100));
    pointers.down({ ...finger(3, 300, 100), primary: true });
    expect(pointers.move(finger(3, 340, 100), height_px)).toEqual([
      { kind: 'look', dx: 0.1, dy: 0 },
    ]);
    expect([pointers.release_all(), pointers.release_all(), pointers.count]).toEqual([
      true,
      false,
      0,
    ]);
  });

  it('ignores a third finger, and keeps looking when one of two is lifted', () => {
    const pointers = held(finger(1, 100, 100), finger(2, 200, 100), finger(3, 300, 100));
    expect(pointers.move(finger(3, 310, 100), height_px)).toEqual([]);
    pointers.up(1);
    expect(pointers.move(finger(2, 240, 100), height_px)).toEqual([
      { kind: 'look', dx: 0.1, dy: 0 },
    ]);
  });
});

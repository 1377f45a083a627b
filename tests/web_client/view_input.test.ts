import { afterEach, beforeEach, describe, expect, it, vi } from 'vitest';
import { Inertia } from '#client/camera/inertia';
import { is_held } from '#client/camera/movement';
import { bind_view_input } from '#client/input/view_input';

let view: EventTarget;
let input: ReturnType<typeof bind_view_input>;
let heard: string[];

beforeEach(() => {
  vi.spyOn(console, 'warn').mockImplementation(() => undefined);
  vi.stubGlobal('window', new EventTarget());
  vi.stubGlobal('document', new EventTarget());
  vi.stubGlobal('HTMLElement', Map); // no target is one
  heard = [];
  view = Object.assign(new EventTarget(), {
    clientHeight: 400,
    classList: { toggle: () => false },
    getBoundingClientRect: () => ({ left: 0, top: 0, width: 400, height: 400 }),
    setPointerCapture: () => undefined,
  });
  input = bind_view_input(view as HTMLElement, new Inertia(), {
    gesture: ({ kind }) => heard.push(kind),
    wheeled: (steps) => heard.push(`wheel ${steps}`),
    keys_changed: () => undefined,
    let_go: () => heard.push('let go'),
    wants_presses: () => false,
    pointed: ({ how }) => heard.push(how),
  });
});

afterEach(() => {
  vi.restoreAllMocks();
  vi.unstubAllGlobals();
});

const send = (to: EventTarget, kind: string, fields: object = {}): void =>
  void to.dispatchEvent(Object.assign(new Event(kind, { cancelable: true }), fields));
const key = (kind: string, code: string, fields: object = {}): void =>
  send(window, kind, { code, key: code.replace('Key', '').toLowerCase(), ...fields });
const mouse = (kind: string, clientX: number, buttons: number): void =>
  send(view, kind, {
    ...{ pointerId: 1, pointerType: 'mouse', isPrimary: true },
    ...{ button: 0, buttons, clientX, clientY: 0 },
  });

function moves_on(): boolean {
  for (let step = 0; step < 10; ++step) input.keys.axes(); // a tap lasts some steps
  return is_held(input.keys.axes());
}

describe('a key whose end is lost', () => {
  const ends: readonly (readonly [string, () => void])[] = [
    ['since Cmd is held', () => key('keydown', 'MetaLeft', { key: 'Meta', metaKey: true })],
    ['since it was held when Cmd came', () => key('keydown', 'KeyC', { metaKey: true })],
    ['since the page lost the keyboard', () => send(window, 'blur')],
    ['since the page was hidden', () => send(document, 'visibilitychange')],
  ];
  it.each(ends)('is let go: %s', (_name, lose) => {
    key('keydown', 'KeyW');
    expect(moves_on()).toBe(true);
    lose();
    expect(moves_on()).toBe(false);
  });

  it('is none of a tool without positions: its end comes by letter', () => {
    key('keydown', '', { key: 'w' });
    expect(moves_on()).toBe(true);
    key('keyup', '', { key: 'W' });
    expect(moves_on()).toBe(false);
  });
});

describe('a pointer whose end is lost', () => {
  it.each([
    ['it comes back without a button', () => mouse('pointermove', 50, 0)],
    ['the page was hidden', () => send(document, 'visibilitychange')],
  ])('is let go: %s', (_name, lose) => {
    mouse('pointerdown', 0, 1);
    mouse('pointermove', 40, 1);
    lose();
    mouse('pointermove', 60, 1);
    expect(heard).toEqual(['look', 'let go']);
    expect(input.pointers.count).toBe(0);
  });
});

describe('a pointer that cannot be captured', () => {
  it('looks all the same', () => {
    Object.assign(view, {
      setPointerCapture: () => {
        throw new DOMException('no such pointer', 'NotFoundError');
      },
    });
    mouse('pointerdown', 0, 1);
    mouse('pointermove', 40, 1);
    mouse('pointerup', 40, 0);
    expect(heard).toEqual(['look', 'let go']);
  });
});

describe('a wheel', () => {
  const wheel = (fields: object): void =>
    send(view, 'wheel', { deltaX: 0, deltaY: 0, deltaMode: 0, ...fields });

  it('turned with Shift comes sideways, and one that only drifts sideways is none', () => {
    wheel({ deltaX: -100, shiftKey: true });
    wheel({ deltaX: 40 });
    wheel({ deltaY: Number.NaN });
    expect(heard).toEqual(['wheel 1']);
  });

  it('is the pinch of a trackpad in Safari, too', () => {
    send(view, 'gesturestart', { scale: 1 });
    send(view, 'gesturechange', { scale: 1.13 });
    send(view, 'gesturechange', { scale: 1.13 ** 3 });
    expect(heard.map((what) => Number(what.split(' ')[1]).toFixed(3))).toEqual(['1.000', '2.000']);
  });
});

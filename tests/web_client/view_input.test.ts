import { afterEach, beforeEach, describe, expect, it, vi } from 'vitest';
import { Inertia } from '#client/camera/inertia';
import { is_held } from '#client/camera/movement';
import { ScrollGate } from '#client/input/scroll_gate';
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
  input = bind('', false);
});

/** `search`: of the page's address. */
function bind(search: string, is_framed: boolean): ReturnType<typeof bind_view_input> {
  view = Object.assign(new EventTarget(), {
    clientHeight: 400,
    classList: { toggle: () => false },
    getBoundingClientRect: () => ({ left: 0, top: 0, width: 400, height: 400 }),
    setPointerCapture: () => undefined,
  });
  const gate = new ScrollGate(view as HTMLElement, { search }, is_framed);
  gate.refused.listen(() => heard.push('refused'));
  return bind_view_input(view as HTMLElement, new Inertia(), gate, {
    gesture: ({ kind }) => heard.push(kind),
    wheeled: (steps) => heard.push(`wheel ${steps}`),
    keys_changed: () => undefined,
    let_go: () => heard.push('let go'),
    wants_presses: () => false,
    pointed: ({ how }) => heard.push(how),
  });
}

afterEach(() => {
  vi.restoreAllMocks();
  vi.unstubAllGlobals();
});

const send = (to: EventTarget, kind: string, fields: object = {}): void =>
  void to.dispatchEvent(Object.assign(new Event(kind, { cancelable: true }), fields));
const key = (kind: string, code: string, fields: object = {}): void =>
  send(window, kind, { code, key: code.replace('Key', '').toLowerCase(), ...fields });
const mouse = (kind: string, clientX: number, buttons: number, pointerType = 'mouse'): void =>
  send(view, kind, {
    ...{ pointerId: 1, pointerType, isPrimary: true },
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

const wheel = (fields: object): void =>
  send(view, 'wheel', { deltaX: 0, deltaY: 0, deltaMode: 0, ...fields });

describe('a wheel', () => {
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

describe('in a frame of an article', () => {
  const swipe = (): void => {
    mouse('pointerdown', 0, 1, 'touch');
    mouse('pointermove', 40, 1, 'touch');
    mouse('pointercancel', 40, 0, 'touch');
  };

  /** What the frame takes of a wheel, a finger, a trackpad's pinch and a mouse. */
  function taken(): string[] {
    heard = [];
    wheel({ deltaY: -100 });
    swipe();
    wheel({ deltaY: -10, ctrlKey: true });
    mouse('pointerdown', 0, 1);
    mouse('pointermove', 40, 1);
    mouse('pointercancel', 40, 0);
    return heard;
  }
  const article = ['refused', 'wheel 0.8', 'look', 'let go'];
  const all = ['wheel 1', 'look', 'let go', 'wheel 0.8', 'look', 'let go'];

  // What it takes at first, after a click into it, and after one elsewhere.
  it.each([
    ['wheel and finger scroll the article until a click', '', [article, all, article]],
    ['?scroll=always takes them', '?scroll=always', [all, all, all]],
    ['?scroll=never leaves them', '?scroll=never', [article, article, article]],
  ])('%s', (_name, search, expected) => {
    bind(search, true);
    const seen = [taken()];
    send(window, 'click');
    seen.push(taken());
    send(window, 'blur');
    seen.push(taken());
    expect(seen).toEqual(expected);
  });
});

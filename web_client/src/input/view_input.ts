// Turns DOM events of the view into gestures and held keys.
import { browser_timers } from '../base/clock';
import type { Inertia } from '../camera/inertia';
import type { Gesture } from '../camera/movement';
import { is_for_page, position_of } from './key';
import { HeldKeys } from './keyboard';
import { capture } from './pass_drags';
import {
  LongPress,
  pinch_steps,
  Pointers,
  Taps,
  wheel_steps,
  type Pointed,
  type PointerSample,
} from './pointers';
import type { ScrollGate } from './scroll_gate';

export type { ScrollGate };

interface ViewInputListener {
  gesture(gesture: Gesture): void;
  /** `steps`: notches towards the scene. */
  wheeled(steps: number, is_pinch: boolean): void;
  keys_changed(): void;
  /** No pointer is down any more, and nothing glides on. */
  let_go(): void;
  /** Whether somebody hears presses. Otherwise they are drags and clicks. */
  wants_presses(): boolean;
  pointed(pointed: Pointed): void;
}

export function bind_view_input(
  view: HTMLElement,
  inertia: Inertia,
  gate: ScrollGate,
  listener: ViewInputListener,
): { keys: HeldKeys; pointers: Pointers } {
  const keys = new HeldKeys();
  const pointers = new Pointers();
  const release = bind_pointers(view, pointers, inertia, gate, listener);
  bind_wheel(view, inertia, gate, listener);
  view.addEventListener('contextmenu', (event) => event.preventDefault());
  bind_keys(keys, listener);
  // What was let go elsewhere is not heard of here.
  window.addEventListener('blur', () => keys.release_all());
  document.addEventListener('visibilitychange', () => {
    keys.release_all();
    release();
  });
  bind_focus(view);
  return { keys, pointers };
}

function bind_pointers(
  view: HTMLElement,
  pointers: Pointers,
  inertia: Inertia,
  gate: ScrollGate,
  listener: ViewInputListener,
): () => void {
  const taps = new Taps();
  const press = new LongPress(browser_timers);
  /** Shares of the view's width and height. */
  const project = ({ clientX, clientY }: PointerEvent): Pick<Pointed, 'x' | 'y'> => {
    const { left, top, width, height } = view.getBoundingClientRect();
    return { x: (clientX - left) / width, y: (clientY - top) / height };
  };
  view.addEventListener('pointerdown', (event) => {
    if (!gate.takes(event)) return;
    press.end();
    if (listener.wants_presses() && event.isPrimary && event.button === 0) {
      const pressed = (): void => listener.pointed({ ...project(event), how: 'press' });
      if (event.altKey) return pressed();
      press.begin(event.clientX, event.clientY, () => {
        if (!listener.wants_presses()) return;
        taps.cancel(); // for the camera it is over
        if (pointers.up(event.pointerId)) listener.let_go();
        pressed();
      });
    }
    if (event.button === 1) event.preventDefault(); // no scrolling by the middle button
    capture(view, event.pointerId);
    inertia.stop();
    pointers.down(sample_of(event));
    taps.down(event.clientX, event.clientY, pointers.count === 1 && event.button === 0);
  });
  /** The pointer went up, or its end was lost. */
  const ended = (id: number): boolean => {
    press.end();
    return pointers.up(id);
  };
  view.addEventListener('pointermove', (event) => {
    if (event.buttons === 0 && event.pointerType !== 'touch')
      return ended(event.pointerId) ? listener.let_go() : undefined;
    // Until it is a drag, the camera hears nothing of it: a participant's would leave the host.
    if (press.may_come(event.clientX, event.clientY)) return;
    for (const gesture of pointers.move(sample_of(event), view.clientHeight)) {
      inertia.moved(gesture, event.timeStamp);
      listener.gesture(gesture);
    }
  });
  for (const end of ['pointerup', 'pointercancel', 'lostpointercapture'] as const) {
    view.addEventListener(end, (event) => {
      const lifted = ended(event.pointerId);
      if (end === 'pointercancel') taps.cancel();
      if (end === 'pointerup') {
        const what = taps.up(event.timeStamp, event.clientX, event.clientY);
        const how = what !== 'tap' ? what : event.pointerType === 'touch' ? 'touch' : 'click';
        if (how !== 'drag') listener.pointed({ ...project(event), how });
      }
      if (lifted && end === 'pointerup' && inertia.released(event.timeStamp)) {
        listener.keys_changed();
      } else if (lifted) {
        listener.let_go();
      }
    });
  }
  return () => {
    press.end();
    taps.cancel();
    if (pointers.release_all()) listener.let_go();
  };
}

function bind_wheel(
  view: HTMLElement,
  inertia: Inertia,
  gate: ScrollGate,
  listener: ViewInputListener,
): void {
  view.addEventListener(
    'wheel',
    (event) => {
      if (!gate.takes(event)) return;
      event.preventDefault();
      // With Shift, systems turn a wheel into a sideways one.
      const delta = event.deltaY || (event.shiftKey ? event.deltaX : 0);
      const steps = wheel_steps(delta, event.deltaMode, event.ctrlKey);
      if (steps === 0) return;
      inertia.stop();
      listener.wheeled(steps, event.ctrlKey);
    },
    { passive: false },
  );
  // Safari on a Mac tells of the pinch of a trackpad like this, and on a phone besides the pointers.
  let scale = 1;
  for (const kind of ['gesturestart', 'gesturechange'])
    view.addEventListener(kind, (event) => {
      event.preventDefault();
      const { scale: now } = event as Event & { readonly scale: number };
      if (kind === 'gesturechange' && !('ontouchend' in window))
        listener.wheeled(pinch_steps(now / scale), true);
      scale = now;
    });
}

function bind_keys(keys: HeldKeys, listener: ViewInputListener): void {
  window.addEventListener('keydown', (event) => {
    // While Cmd is held, macOS does not tell of keys that are let go.
    if (event.metaKey) keys.release_all();
    if (!is_for_page(event)) return;
    if (!keys.down(position_of(event), event.shiftKey)) return;
    event.preventDefault();
    listener.keys_changed();
  });
  window.addEventListener('keyup', (event) => keys.up(position_of(event), event.shiftKey));
}

/**
 * Marks focus that came by Tab. (`:focus-visible` would also frame the picture for visitors who clicked
 * on it and then fly by keys.)
 */
function bind_focus(view: HTMLElement): void {
  let by_tab = false;
  const mark = (): void => void view.classList.toggle('focus-by-tab', by_tab);
  const listen = { capture: true };
  window.addEventListener('keydown', (event) => (by_tab = event.key === 'Tab'), listen);
  window.addEventListener(
    'pointerdown',
    () => {
      by_tab = false;
      mark();
    },
    listen,
  );
  view.addEventListener('focus', mark);
}

function sample_of(event: PointerEvent): PointerSample {
  return {
    id: event.pointerId,
    type: event.pointerType,
    x: event.clientX,
    y: event.clientY,
    buttons: event.buttons,
    shift: event.shiftKey,
    primary: event.isPrimary,
  };
}

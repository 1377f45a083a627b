// Turns DOM events of the view into gestures and held keys.
import { browser_timers } from '../base/clock';
import type { Inertia } from '../camera/inertia';
import type { Gesture } from '../camera/movement';
import { HeldKeys } from './keyboard';
import {
  LongPress,
  Pointers,
  Taps,
  wheel_steps,
  type Pointed,
  type PointerSample,
} from './pointers';

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
  listener: ViewInputListener,
): { keys: HeldKeys; pointers: Pointers } {
  const keys = new HeldKeys();
  const pointers = new Pointers();
  bind_pointers(view, pointers, inertia, listener);
  bind_keys(keys, listener);
  bind_focus(view);
  return { keys, pointers };
}

function bind_pointers(
  view: HTMLElement,
  pointers: Pointers,
  inertia: Inertia,
  listener: ViewInputListener,
): void {
  const taps = new Taps();
  const press = new LongPress(browser_timers);
  /** Shares of the view's width and height. */
  const project = ({ clientX, clientY }: PointerEvent): Pick<Pointed, 'x' | 'y'> => {
    const { left, top, width, height } = view.getBoundingClientRect();
    return { x: (clientX - left) / width, y: (clientY - top) / height };
  };
  view.addEventListener('pointerdown', (event) => {
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
    view.setPointerCapture(event.pointerId);
    inertia.stop();
    pointers.down(sample_of(event));
    taps.down(event.clientX, event.clientY, pointers.count === 1 && event.button === 0);
  });
  view.addEventListener('pointermove', (event) => {
    // Until it is a drag, the camera hears nothing of it: a participant's would leave the host.
    if (press.may_come(event.clientX, event.clientY)) return;
    for (const gesture of pointers.move(sample_of(event), view.clientHeight)) {
      inertia.moved(gesture, event.timeStamp);
      listener.gesture(gesture);
    }
  });
  for (const end of ['pointerup', 'pointercancel', 'lostpointercapture'] as const) {
    view.addEventListener(end, (event) => {
      press.end();
      const lifted = pointers.up(event.pointerId);
      if (end === 'pointercancel') taps.cancel();
      if (end === 'pointerup') {
        const what = taps.up(event.timeStamp, event.clientX, event.clientY);
        const single = event.pointerType === 'touch' ? 'touch' : 'click';
        if (what !== 'drag')
          listener.pointed({ ...project(event), how: what === 'tap' ? single : what });
      }
      if (lifted && end === 'pointerup' && inertia.released(event.timeStamp)) {
        listener.keys_changed();
      } else if (lifted) {
        listener.let_go();
      }
    });
  }
  view.addEventListener('contextmenu', (event) => event.preventDefault());
  view.addEventListener(
    'wheel',
    (event) => {
      event.preventDefault();
      inertia.stop();
      listener.wheeled(wheel_steps(event.deltaY, event.deltaMode, event.ctrlKey), event.ctrlKey);
    },
    { passive: false },
  );
}

function bind_keys(keys: HeldKeys, listener: ViewInputListener): void {
  window.addEventListener('keydown', (event) => {
    if (!is_for_page(event)) return;
    if (!keys.down(event.code, event.shiftKey)) return;
    event.preventDefault();
    listener.keys_changed();
  });
  window.addEventListener('keyup', (event) => keys.up(event.code, event.shiftKey));
  window.addEventListener('blur', () => keys.release_all());
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

/** Whether a key is ours, and neither a form field's nor a shortcut of the browser. */
export function is_for_page({ ctrlKey, metaKey, altKey, target }: KeyboardEvent): boolean {
  const is_typing = target instanceof HTMLElement && target.matches('input, select, textarea');
  return !ctrlKey && !metaKey && !altKey && !is_typing;
}

function sample_of(event: PointerEvent): PointerSample {
  return {
    id: event.pointerId,
    type: event.pointerType,
    x: event.clientX,
    y: event.clientY,
    buttons: event.buttons,
    shift: event.shiftKey,
  };
}

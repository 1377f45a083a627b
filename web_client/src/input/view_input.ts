// Binds pointers, wheel and keyboard of the view to gestures and held keys.
import type { Gesture } from '../camera/camera_controller';
import { HeldKeys } from './keyboard';
import { Pointers, wheel_gesture, type PointerSample } from './pointers';

export interface ViewInputListener {
  gesture(gesture: Gesture): void;
  keys_changed(): void;
}

export function bind_view_input(view: HTMLElement, listener: ViewInputListener): HeldKeys {
  const keys = new HeldKeys();
  bind_pointers(view, listener);
  bind_keys(keys, listener);
  bind_focus(view);
  return keys;
}

function bind_pointers(view: HTMLElement, listener: ViewInputListener): void {
  const pointers = new Pointers();
  view.addEventListener('pointerdown', (event) => {
    if (event.button === 1) event.preventDefault(); // no scrolling by the middle button
    view.setPointerCapture(event.pointerId);
    pointers.down(sample_of(event));
  });
  view.addEventListener('pointermove', (event) => {
    for (const gesture of pointers.move(sample_of(event), view.clientHeight)) {
      listener.gesture(gesture);
    }
  });
  for (const end of ['pointerup', 'pointercancel', 'lostpointercapture'] as const) {
    view.addEventListener(end, (event) => pointers.up(event.pointerId));
  }
  view.addEventListener('contextmenu', (event) => event.preventDefault());
  view.addEventListener(
    'wheel',
    (event) => {
      event.preventDefault();
      listener.gesture(wheel_gesture(event.deltaY, event.deltaMode, event.ctrlKey));
    },
    { passive: false },
  );
}

function bind_keys(keys: HeldKeys, listener: ViewInputListener): void {
  window.addEventListener('keydown', (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || is_typing(event.target)) return;
    if (!keys.down(event.code, event.shiftKey)) return;
    event.preventDefault();
    listener.keys_changed();
  });
  window.addEventListener('keyup', (event) => keys.up(event.code, event.shiftKey));
  window.addEventListener('blur', () => keys.release_all());
}

/**
 * Marks focus that came by Tab. (`:focus-visible` also frames the picture for whoever clicked on it
 * and then flies by keys.)
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

/** Whether a key belongs to a control of the page and not to the camera. */
export function is_typing(target: EventTarget | null): boolean {
  return target instanceof HTMLElement && target.matches('input, select, textarea');
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

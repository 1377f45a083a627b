import { is_tap } from './pointers';

/** Lets a drag that begins on `button`, which lies over the view, move the camera. A press without movement clicks. */
export function pass_drags(button: HTMLElement, view: HTMLElement): void {
  const pressed = new Map<number, PointerEvent>();
  let dragged = false;
  button.addEventListener('pointerdown', (event) => {
    dragged = false;
    pressed.set(event.pointerId, event);
    capture(button, event.pointerId); // a mouse leaves the button before it has moved far enough
  });
  button.addEventListener('pointermove', (event) => {
    const down = pressed.get(event.pointerId);
    if (!down || is_tap(down.clientX, down.clientY, event.clientX, event.clientY)) return;
    pressed.delete(event.pointerId);
    dragged = true;
    view.dispatchEvent(new PointerEvent('pointerdown', down)); // the view captures the pointer
  });
  for (const end of ['pointerup', 'pointercancel'])
    button.addEventListener(end, (event) => pressed.delete((event as PointerEvent).pointerId));
  button.addEventListener(
    'click',
    (event) => {
      // Keys click, too, and have no pointer.
      if (dragged && event.detail > 0) event.stopImmediatePropagation();
    },
    { capture: true },
  );
}

/** Pointers that an assistive tool makes up, or that are up by now, cannot be captured. */
export function capture(element: HTMLElement, pointer_id: number): void {
  try {
    element.setPointerCapture(pointer_id);
  } catch (error) {
    console.warn('a pointer cannot be captured', error);
  }
}

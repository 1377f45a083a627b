// How long the page waits for a browser that may never answer.
import type { Timers } from './clock';

/** After this time awake, a step of a picture on its way to the canvas will not end any more. */
export const longest_step_s = 3;
const longest_refresh_ms = 500;

/** Runs `action` after so many seconds awake: a machine that sleeps does not wait. The result cancels it. */
export function after_awake(timers: Timers, seconds: number, action: () => void): () => void {
  let cancel: () => void;
  const wait = (left: number): void => {
    cancel = timers.after(1000, () => (left > 1 ? wait(left - 1) : action()));
  };
  wait(seconds);
  return () => cancel();
}

/** Ends as the step does, or with an error if it takes too long. */
export function in_time<T>(timers: Timers, step: Promise<T>): Promise<T> {
  return new Promise((resolve, reject) => {
    const cancel = after_awake(timers, longest_step_s, () => reject(new Error('no answer')));
    step.then(resolve, reject).finally(cancel);
  });
}

/** Asks for the next refresh of the display, and does not wait long where none comes. */
export function refreshes(
  request: (draw: () => void) => void,
  timers: Timers,
): (draw: () => void) => void {
  return (draw) => {
    let is_due = true;
    const once = (): void => {
      if (!is_due) return;
      is_due = false;
      cancel();
      draw();
    };
    const cancel = timers.after(longest_refresh_ms, once);
    request(once);
  };
}

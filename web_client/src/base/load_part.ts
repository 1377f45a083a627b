// Parts of the page that load when somebody needs them. The connection may be away for a moment then.
import { Signal } from './signal';

/** Whether a part is missing that somebody needs, and tried again. */
export const part_missing = new Signal<boolean>();

const pauses_ms = [1000, 2000, 4000, 8000, 15_000, 30_000];
let missing = 0;

function count(change: 1 | -1): void {
  missing += change;
  part_missing.emit(missing > 0);
}

/** Tries for a minute. Rejects with the last error; the visitor has been told by then. */
export async function load_part<T>(load: () => Promise<T>): Promise<T> {
  for (let failures = 0; ; ++failures) {
    try {
      const part = await load();
      if (failures > 0) count(-1);
      return part;
    } catch (error) {
      if (failures === 0) count(1);
      const pause_ms = pauses_ms[failures];
      if (pause_ms === undefined) {
        missing -= 1; // nobody waits for it any more; the notice stays
        throw error;
      }
      await new Promise((resolve) => setTimeout(resolve, pause_ms));
    }
  }
}

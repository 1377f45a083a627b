/**
 * One monotonic clock for page and worker, in microseconds. The two have different time origins, so both
 * count from the page's origin. All client times on the wire are of this clock.
 */
export interface Clock {
  now_us(): number;
}

export function clock_from(page_origin_ms: number): Clock {
  const offset_ms = performance.timeOrigin - page_origin_ms;
  return { now_us: () => Math.round((performance.now() + offset_ms) * 1000) };
}

export interface Timers {
  /** Runs `action` once, `delay_ms` from now; the result cancels it. */
  after(delay_ms: number, action: () => void): () => void;
}

export const browser_timers: Timers = {
  after(delay_ms, action) {
    const id = setTimeout(action, delay_ms);
    return () => clearTimeout(id);
  },
};

const first_ms = 500;
const longest_ms = 10_000;

/**
 * Time to wait before connection attempt `attempt` (1 = first retry). It is exponential with "equal
 * jitter", so that clients of a restarted server do not all return at once. `random`: uniform in [0, 1).
 */
export function backoff_ms(attempt: number, random: () => number): number {
  const ceiling_ms = Math.min(longest_ms, first_ms * 2 ** Math.min(attempt - 1, 16));
  return ceiling_ms * (0.5 + 0.5 * random());
}

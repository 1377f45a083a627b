// Measures the shift between two pictures of the same thing, block by block.
import type { Picture } from './pictures';

export interface Shift {
  readonly dx: number;
  readonly dy: number;
}

/** The green channel, which carries most of the luminance. */
const value = (picture: Picture, x: number, y: number): number =>
  picture.rgba[(y * picture.width + x) * 4 + 1]!;

const search_px = 24;

/** Sum of squared differences of a block of `a` and the block of `b` that lies (dx, dy) from it. */
function difference(
  a: Picture,
  b: Picture,
  x: number,
  y: number,
  side: number,
  dx: number,
  dy: number,
): number {
  let sum = 0;
  for (let row = y; row < y + side; row += 2) {
    for (let column = x; column < x + side; column += 2) {
      sum += (value(a, column, row) - value(b, column + dx, row + dy)) ** 2;
    }
  }
  return sum;
}

/** Minimum of the parabola through three values, relative to the middle one. */
function vertex(before: number, at: number, after: number): number {
  const curvature = before - 2 * at + after;
  return curvature > 0 ? (before - after) / 2 / curvature : 0;
}

/** Shift of a block by full search, refined below a pixel; undefined for blocks without structure. */
function shift_of(a: Picture, b: Picture, x: number, y: number, side: number): Shift | undefined {
  const at = (dx: number, dy: number): number => difference(a, b, x, y, side, dx, dy);
  let best = { dx: 0, dy: 0, sum: Infinity };
  let all = 0;
  for (let dy = -search_px; dy <= search_px; dy += 1) {
    for (let dx = -search_px; dx <= search_px; dx += 1) {
      const sum = at(dx, dy);
      all += sum;
      if (sum < best.sum) best = { dx, dy, sum };
    }
  }
  const mean = all / (2 * search_px + 1) ** 2;
  const at_border = Math.max(Math.abs(best.dx), Math.abs(best.dy)) === search_px;
  if (mean < side * side * 20 || best.sum > mean * 0.3 || at_border) return undefined;
  return {
    dx: best.dx + vertex(at(best.dx - 1, best.dy), best.sum, at(best.dx + 1, best.dy)),
    dy: best.dy + vertex(at(best.dx, best.dy - 1), best.sum, at(best.dx, best.dy + 1)),
  };
}

/** Shifts of all blocks with structure. The pictures have the same size. */
export function block_shifts(a: Picture, b: Picture, side = 32): Shift[] {
  const shifts: Shift[] = [];
  for (let y = search_px + 1; y + side + search_px < a.height; y += side) {
    for (let x = search_px + 1; x + side + search_px < a.width; x += side) {
      const shift = shift_of(a, b, x, y, side);
      if (shift) shifts.push(shift);
    }
  }
  return shifts;
}

export function median(values: readonly number[]): number {
  const sorted = [...values].sort((p, q) => p - q);
  return sorted[Math.floor(sorted.length / 2)] ?? NaN;
}

// Where a hotspot is seen and pressed, though something of the page lies over its place. Pure.
type Point = readonly [x: number, y: number];

/** Of an element, in the view; px. */
export interface Cover {
  readonly left: number;
  readonly right: number;
  readonly top: number;
  readonly bottom: number;
}

const room_px = 24; // half of what fingers need

/** The point, or the nearest one in the view that no cover reaches. */
export function uncovered(at: Point, covers: readonly Cover[], [width, height]: Point): Point {
  const is_free = ([x, y]: Point): boolean =>
    x >= 0 &&
    y >= 0 &&
    x <= width &&
    y <= height &&
    !covers.some(
      ({ left, right, top, bottom }) =>
        x > left - room_px && x < right + room_px && y > top - room_px && y < bottom + room_px,
    );
  const [x, y] = at;
  const far = ([to_x, to_y]: Point): number => Math.abs(to_x - x) + Math.abs(to_y - y);
  const beside = covers.flatMap(({ left, right, top, bottom }): Point[] => [
    [x, top - room_px],
    [x, bottom + room_px],
    [left - room_px, y],
    [right + room_px, y],
  ]);
  return [at, ...beside].filter(is_free).sort((a, b) => far(a) - far(b))[0] ?? at;
}

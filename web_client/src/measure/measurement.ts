// Lengths, heights and areas between points of the scene, with their errors. Pure.
import { add, cross, dot, length, normalize, scale, sub, type Vec3 } from '../base/vector';

/** A point that the visitor has marked. Standard deviations are in world units. */
export interface Mark {
  readonly point: Vec3;
  /** Of the ray that found it; unit. */
  readonly direction: Vec3;
  /** Along the ray: how thick the surface is there. */
  readonly along: number;
  /** At a right angle to it: how exactly one can point. */
  readonly across: number;
}

/** A value and its error at two standard deviations. */
export interface Measured {
  readonly value: number;
  readonly error: number;
}

/** Error of a function of the marks, from its gradient by each (Gaussian propagation, first order). */
function error_of(marks: readonly Mark[], gradients: readonly Vec3[]): number {
  const variance = marks.reduce((sum, { direction, along, across }, i) => {
    const gradient = gradients[i]!;
    const by_depth = dot(gradient, direction);
    const aside = Math.max(0, dot(gradient, gradient) - by_depth ** 2);
    return sum + (by_depth * along) ** 2 + aside * across ** 2;
  }, 0);
  return 2 * Math.sqrt(variance);
}

const none: Vec3 = [0, 0, 0];

/** Length of the line through all marks, world units. */
export function length_of(marks: readonly Mark[]): Measured {
  const ways = marks.slice(1).map(({ point }, i) => sub(point, marks[i]!.point));
  const along = ways.map((way) => normalize(way, none));
  const gradients = marks.map((_, i) => sub(along[i - 1] ?? none, along[i] ?? none));
  return {
    value: ways.reduce((sum, way) => sum + length(way), 0),
    error: error_of(marks, gradients),
  };
}

/** How far the last mark is above the first one. `up`: unit. */
export function rise_of(marks: readonly Mark[], up: Vec3): Measured {
  const [first, last] = [marks[0], marks[marks.length - 1]];
  if (!first || !last) return { value: 0, error: 0 };
  return {
    value: dot(sub(last.point, first.point), up),
    error: error_of([first, last], [scale(up, -1), up]),
  };
}

/** Area of the polygon whose corners are the marks. Of one that is not flat, it is the largest projection. */
export function area_of(marks: readonly Mark[]): Measured {
  const at = (i: number): Vec3 => marks[(i + marks.length) % marks.length]!.point;
  const origin = marks[0]?.point ?? none;
  const twice = marks.reduce<Vec3>(
    (sum, { point }, i) => add(sum, cross(sub(point, origin), sub(at(i + 1), origin))),
    none,
  );
  const normal = normalize(twice, none);
  const gradients = marks.map((_, i) => scale(cross(normal, sub(at(i - 1), at(i + 1))), 0.5));
  return { value: length(twice) / 2, error: error_of(marks, gradients) };
}

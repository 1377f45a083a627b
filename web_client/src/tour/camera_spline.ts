// Camera films: keyframes with smooth curves between them. Pure.
import { look_at, type Vec3 } from '../base/vector';
import type { Flight } from '../camera/flight';

/** A keyframe: position, point looked at, and vertical field of view. */
export interface Shot {
  readonly position: Vec3;
  readonly target: Vec3;
  readonly fov_y_rad: number;
}

export interface Film {
  readonly times_s: readonly number[]; // increasing
  readonly shots: readonly Shot[]; // one for each time
  readonly duration_s: number;
  readonly smoothness: number; // of the tangents: 0 stops at every shot, 1 is a Catmull-Rom spline
  readonly steps: boolean; // jumps from shot to shot
  readonly loop: 'none' | 'repeat' | 'pingpong';
}

type Values = readonly number[];

const values_of = ({ position, target, fov_y_rad }: Shot): Values => [
  ...position,
  ...target,
  fov_y_rad,
];

/** One knot of a cubic Hermite curve. */
interface Knot {
  readonly time_s: number;
  readonly value: Values;
  readonly rate: Values; // change a second
}

/** A repeating film returns from its last shot to its first, in an added second where it has no time left. */
function knots_of(film: Film): { knots: Knot[]; length_s: number } {
  const points = film.shots.map((shot, i) => ({
    time_s: film.times_s[i]!,
    value: values_of(shot),
  }));
  const last_s = points[points.length - 1]?.time_s ?? 0;
  const closes = film.loop === 'repeat' && points.length > 1;
  const length_s =
    closes && film.duration_s - last_s < 1e-6 ? film.duration_s + 1 : film.duration_s;
  const around = (i: number): { time_s: number; value: Values } | undefined => {
    const n = points.length;
    if (i >= 0 && i < n) return points[i];
    if (!closes) return undefined;
    const wrapped = points[(i + n) % n]!;
    return { time_s: wrapped.time_s + (i < 0 ? -length_s : length_s), value: wrapped.value };
  };
  const knot = (i: number): Knot | undefined => {
    const at = around(i);
    if (!at) return undefined;
    const before = around(i - 1) ?? at;
    const after = around(i + 1) ?? at;
    const span_s = after.time_s - before.time_s;
    const rate = at.value.map((_, k) =>
      span_s > 0 ? ((after.value[k]! - before.value[k]!) / span_s) * film.smoothness : 0,
    );
    return { ...at, rate };
  };
  const all = points.map((_, i) => knot(i)!);
  const first = all[0];
  const knots = closes && first ? [...all, { ...first, time_s: first.time_s + length_s }] : all;
  return { knots, length_s };
}

function between(a: Knot, b: Knot, time_s: number): Values {
  const span_s = b.time_s - a.time_s;
  const t = (time_s - a.time_s) / span_s;
  const share = t * t * (3 - 2 * t);
  const out = t * (1 - t) * (1 - t) * span_s;
  const into = t * t * (1 - t) * span_s;
  return a.value.map(
    (v, k) => v * (1 - share) + b.value[k]! * share + a.rate[k]! * out - b.rate[k]! * into,
  );
}

/** The film as a flight: there and back for a ping-pong, around for a film that repeats. */
export function film_flight(film: Film, up: Vec3): Flight & { readonly repeats: boolean } {
  const { knots, length_s } = knots_of(film);
  const there_and_back = film.loop === 'pingpong';
  const value_at = (time_s: number): Values => {
    const next = knots.findIndex((knot) => knot.time_s > time_s);
    if (next === 0) return knots[0]!.value;
    if (next < 0) return knots[knots.length - 1]!.value;
    const [a, b] = [knots[next - 1]!, knots[next]!];
    return film.steps ? a.value : between(a, b, time_s);
  };
  return {
    duration_s: there_and_back ? 2 * length_s : length_s,
    repeats: film.loop !== 'none',
    at: (time_s) => {
      const film_s = there_and_back && time_s > length_s ? 2 * length_s - time_s : time_s;
      const [px, py, pz, tx, ty, tz, fov_y_rad] = value_at(film_s) as [
        number,
        number,
        number,
        number,
        number,
        number,
        number,
      ];
      const position: Vec3 = [px, py, pz];
      return { position, orientation: look_at(position, [tx, ty, tz], up), fov_y_rad };
    },
  };
}

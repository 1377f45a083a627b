// Camera movements that are known in advance. Pure.
import { add, angle_between, length, scale, slerp, sub, clamp } from '../base/vector';
import { same_projection, type Eye } from './eye';

export interface Flight {
  readonly duration_s: number;
  /** The camera at `time_s`, which is in 0…duration. */
  at(time_s: number): Eye;
}

/** Where the camera will be on its way. */
export interface PathSample {
  readonly time_us: number;
  readonly eye: Eye;
}

const announced_samples = 64;
const held_us = 1_000_000; // at the end of a flight the camera stays

/** The part of a flight that begins now, at `from_s`, as the server hears of it. */
export function path_of(
  way: Flight,
  from_s: number,
  length_s: number,
  now_us: number,
): PathSample[] {
  const samples = Array.from({ length: announced_samples + 1 }, (_, i): PathSample => {
    const offset_s = (length_s * i) / announced_samples;
    return { time_us: now_us + offset_s * 1e6, eye: way.at(from_s + offset_s) };
  });
  const last = samples[announced_samples]!;
  const stays = from_s + length_s >= way.duration_s - 1e-6;
  return stays ? [...samples, { ...last, time_us: last.time_us + held_us }] : samples;
}

/** Maps 0…1 to 0…1 with zero velocity and acceleration at both ends (Perlin's smootherstep). */
function eased(share: number): number {
  const s = clamp(share, 0, 1);
  return s * s * s * (s * (6 * s - 15) + 10);
}

/** The camera at a share of the straight way; at its end where perspective becomes orthographic, or back. */
export function between(from: Eye, to: Eye, share: number): Eye {
  if (!same_projection(from, to)) return to;
  return {
    position: add(from.position, scale(sub(to.position, from.position), share)),
    orientation: slerp(from.orientation, to.orientation, share),
    fov_y_rad: from.fov_y_rad + (to.fov_y_rad - from.fov_y_rad) * share,
    view_height:
      from.view_height &&
      to.view_height &&
      from.view_height * (to.view_height / from.view_height) ** share,
  };
}

/** At once where perspective becomes orthographic, or back: nothing lies between. */
export function glide(from: Eye, to: Eye, wanted_s: number): Flight {
  const duration_s = same_projection(from, to) ? wanted_s : 0;
  return {
    duration_s,
    at: (time_s) => between(from, to, duration_s > 0 ? eased(time_s / duration_s) : 1),
  };
}

const catch_up_s = 0.08; // smooths the steps between two messages, and is hardly seen as a delay
const pursuit_s = 5 * catch_up_s;

/**
 * After a camera that somebody else moves and that is heard of a few times a second: quick at first, then
 * slower and slower. The next message replaces it before its end.
 */
export function pursuit(from: Eye, to: Eye): Flight {
  return {
    duration_s: pursuit_s,
    at: (time_s) =>
      time_s >= pursuit_s ? to : between(from, to, 1 - Math.exp(-time_s / catch_up_s)),
  };
}

const comfortable_rad_per_s = 0.7;
const comfortable_reach_per_s = 0.5;
const time_range_s = [0.6, 6] as const;

/** Duration of a comfortable glide. `reach`: the scene's scale to a visitor, world units. */
export function glide_time_s(from: Eye, to: Eye, reach: number): number {
  const turn_s = angle_between(from.orientation, to.orientation) / comfortable_rad_per_s;
  const way_s = length(sub(to.position, from.position)) / (reach * comfortable_reach_per_s);
  return clamp(Math.max(turn_s, way_s), ...time_range_s);
}

// Camera movements that are known in advance. Pure.
import { add, angle_between, length, scale, slerp, sub } from '../base/vector';
import type { Eye } from './eye';

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

/** Maps 0…1 to 0…1 with zero velocity and acceleration at both ends (Perlin's smootherstep). */
function eased(share: number): number {
  const s = Math.min(1, Math.max(0, share));
  return s * s * s * (s * (6 * s - 15) + 10);
}

export function glide(from: Eye, to: Eye, duration_s: number): Flight {
  return {
    duration_s,
    at: (time_s) => {
      const share = duration_s > 0 ? eased(time_s / duration_s) : 1;
      return {
        position: add(from.position, scale(sub(to.position, from.position), share)),
        orientation: slerp(from.orientation, to.orientation, share),
        fov_y_rad: from.fov_y_rad + (to.fov_y_rad - from.fov_y_rad) * share,
      };
    },
  };
}

const comfortable_rad_per_s = 0.7;
const comfortable_reach_per_s = 0.5;
const time_range_s = [0.6, 6] as const;

/** Duration of a comfortable glide. `reach`: the scene's scale to a visitor, world units. */
export function glide_time_s(from: Eye, to: Eye, reach: number): number {
  const turn_s = angle_between(from.orientation, to.orientation) / comfortable_rad_per_s;
  const way_s = length(sub(to.position, from.position)) / (reach * comfortable_reach_per_s);
  return Math.min(time_range_s[1], Math.max(time_range_s[0], turn_s, way_s));
}

import type { Quat, Vec3 } from '../base/vector';
import type { Eye } from './eye';

export const camera_modes = ['orbit', 'fly', 'walk'] as const;
export type CameraMode = (typeof camera_modes)[number];

/** Moves a camera in one mode. A controller acts on the rig that it was made for, within its limits. */
export interface ModeController {
  /** Speed of held keys, in scene scales (CameraRig.reach) a second. */
  readonly speed: number;
  /** Turn for a drag across the view's height, rad. Negative: the camera circles. Keys turn the same way. */
  readonly drag_rad: number;
  /** From the eye to what the visitor looks at, world units; Infinity: unknown. */
  readonly sight_distance: number;
  /** Unit direction of "forward". */
  readonly heading: Vec3;
  /** The visitor chose this mode. Returns where the camera has to fly for it, if it has to. */
  begin(): Eye | undefined;
  turn(by: Quat): void;
  /** Moves the camera as far as the mode allows. `climb`: along up. World axes and units. */
  move(movement: Vec3, climb: number): void;
  /** Called after each step of the camera; false: it continues without the visitor. */
  settle?(dt_s: number): boolean;
  /** `steps`: notches of a wheel, > 0 towards the scene. */
  dolly(steps: number): void;
  /** Where the camera goes when the visitor points at something. */
  approach(point: Vec3): Eye;
}

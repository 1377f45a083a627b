import type { Vec3 } from '../base/vector';
import type { Pose } from './eye';

/** What the camera needs to know of a scene. World units; all places are in the coordinates of the scene's file. */
export interface SceneSetup {
  /** Places on the wire have 32 bits and are about it; undefined: about 0. */
  readonly origin?: Vec3 | undefined;
  readonly up: Vec3;
  readonly start_pose: Pose;
  readonly focus: Vec3;
  readonly limits_min: Vec3;
  readonly limits_max: Vec3;
  /** Where nearly all that is drawn lies; undefined: not known. */
  readonly content?: { readonly min: Vec3; readonly max: Vec3 } | undefined;
  readonly near_z: number;
  /** To a visitor; 0: unknown, and judged by the start. */
  readonly scale: number;
  readonly start_fov_y_rad?: number;
  /** Walls are around the start: circling the focus would lead through them. */
  readonly enclosed?: boolean;
}

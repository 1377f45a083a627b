// Cameras as data. Every part of the client that handles cameras uses these types.
import type { Quat, Vec3 } from '../base/vector';

/** Camera axes: x right, y down, z forward. World units. */
export interface Pose {
  readonly position: Vec3;
  readonly orientation: Quat; // camera to world
}

/** A pinhole camera. */
export interface Eye extends Pose {
  readonly fov_y_rad: number;
}

/** Leaves out Gaussians whose centre c has dot(normal, c) > offset. World axes and units. */
export interface ClipPlane {
  readonly normal: Vec3;
  readonly offset: number;
}

/** This page's camera at one time. */
export interface CameraSample {
  readonly pose_id: number;
  readonly time_us: number;
  readonly eye: Eye;
  /** From the eye to what the visitor looks at, along the view axis. World units; Infinity: unknown. */
  readonly distance: number;
  /** True in the repeated last sample of a movement: nothing moves the camera any more. */
  readonly at_rest?: boolean;
}

/** Range of the wire (proto/catgs.proto). */
const fov_range_rad = [0.1, 2.8] as const;

export const limited_fov = (fov_y_rad: number): number =>
  Math.min(fov_range_rad[1], Math.max(fov_range_rad[0], fov_y_rad));

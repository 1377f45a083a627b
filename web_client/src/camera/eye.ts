// Cameras as data. Every part of the client that handles cameras uses these types.
import { clamp, type Quat, type Vec3 } from '../base/vector';

/** Camera axes: x right, y down, z forward. World units. */
export interface Pose {
  readonly position: Vec3;
  readonly orientation: Quat; // camera to world
}

/** A camera. */
export interface Eye extends Pose {
  readonly fov_y_rad: number;
  /** Of an orthographic view, whose rays are parallel to its axis. World units; undefined: perspective. */
  readonly view_height?: number | undefined;
}

/** Half of the view's height at depth 1; at any depth where rays are parallel. World units. */
export const half_height = ({ fov_y_rad, view_height }: Eye): number =>
  view_height === undefined ? Math.tan(fov_y_rad / 2) : view_height / 2;

/** Half of the view's height at this depth. World units. */
export const half_height_at = (eye: Eye, depth: number): number =>
  half_height(eye) * (eye.view_height === undefined ? depth : 1);

export const same_projection = (a: Eye, b: Eye): boolean =>
  (a.view_height === undefined) === (b.view_height === undefined);

/** Leaves out Gaussians whose centre c has dot(normal, c) > offset. World axes and units. */
export interface ClipPlane {
  readonly normal: Vec3;
  readonly offset: number;
}

/** Leaves out Gaussians with their centre outside of a box. */
export interface ClipBox {
  readonly world_from_box: Pose;
  readonly half_extent: Vec3;
}

export type Clip = ClipPlane | ClipBox;

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

/** Ranges of the wire (proto/catgs.proto). */
const fov_range_rad = [0.1, 2.8] as const;
const height_range = [1e-6, 1e9] as const;

export const limited_fov = (fov_y_rad: number): number => clamp(fov_y_rad, ...fov_range_rad);

export const limited_height = (view_height: number): number => clamp(view_height, ...height_range);

/** Field of view whose image plane is `factor` times as large, limited to the range of the wire. */
export const widened_fov = (fov_y_rad: number, factor: number): number =>
  limited_fov(2 * Math.atan(Math.tan(fov_y_rad / 2) * factor));

/** The eye with a view `factor` times as high, limited to the ranges of the wire. */
export const widened = (eye: Eye, factor: number): Eye => ({
  ...eye,
  fov_y_rad: widened_fov(eye.fov_y_rad, factor),
  view_height: eye.view_height && limited_height(eye.view_height * factor),
});

// The camera in its scene: where it is, what it looks at, and where it may go. Pure.
import {
  add,
  axis_angle,
  cross,
  dot,
  forward,
  identity,
  length,
  look_at,
  multiply,
  normalize,
  right,
  rotate,
  scale,
  sub,
  unit,
  type Vec3,
  clamp,
} from '../base/vector';
import { limited_fov, type Eye, type Pose } from './eye';
import type { SceneSetup } from './scene_setup';

const nowhere: Vec3 = [Infinity, Infinity, Infinity];
const standing_rad = Math.PI / 6; // how far below the horizon it then looks
const steepest_level_rad = (85 * Math.PI) / 180; // a steeper view shows no horizon
export const default_fov_y_rad = (60 * Math.PI) / 180;

export class CameraRig {
  pose: Pose = { position: [0, 0, 0], orientation: identity };
  up: Vec3 = [0, -1, 0];
  /** What an orbiting camera circles. */
  focus: Vec3 = [0, 0, 1];
  /** The scene's scale to a visitor, world units: speeds follow it. */
  reach = 1;
  /** The camera comes no nearer to its focus. World units. */
  nearest = 0.1;
  /** The camera may leave the scene's limits, to look at it from outside. */
  unlimited = false;
  /** Visits begin inside. */
  enclosed = false;
  /** Of an orthographic view, world units; undefined: perspective. */
  view_height: number | undefined;
  private fov_y_rad_ = default_fov_y_rad;
  private min_: Vec3 = [0, 0, 0];
  private max_: Vec3 = [0, 0, 0];

  get fov_y_rad(): number {
    return this.fov_y_rad_;
  }

  set fov_y_rad(value: number) {
    this.fov_y_rad_ = limited_fov(value);
  }

  /** Unit direction of the view axis. */
  get view(): Vec3 {
    return rotate(this.pose.orientation, forward);
  }

  load(scene: SceneSetup): void {
    this.up = normalize(scene.up, [0, -1, 0]);
    const start = scene.start_pose;
    this.pose = { position: start.position, orientation: unit(start.orientation) };
    this.view_height = undefined;
    this.fov_y_rad = scene.start_fov_y_rad ?? this.fov_y_rad_;
    this.focus = scene.focus;
    this.nearest = Math.max(scene.near_z, 1e-3) * 1.5;
    const to_focus = length(sub(scene.focus, start.position));
    this.reach = scene.scale > 0 ? scene.scale : Math.max(to_focus, this.nearest * 2);
    if (to_focus < this.nearest) this.focus = this.ahead(this.reach);
    // The limits always contain the start. A scene without limits has min = max.
    const unlimited = scene.limits_max.every((v, i) => v <= scene.limits_min[i]!);
    this.min_ = unlimited ? scale(nowhere, -1) : min(scene.limits_min, start.position);
    this.max_ = unlimited ? nowhere : max(scene.limits_max, start.position);
    this.unlimited = false;
    this.enclosed = scene.enclosed ?? false;
  }

  /** From the eye to the focus; the scene's scale where the focus is too near to pan by. */
  distance(): number {
    const along = dot(sub(this.focus, this.pose.position), this.view);
    return along > this.nearest ? along : this.reach;
  }

  /** Moves the focus to the middle of the view, at the same distance. */
  refocus(): void {
    this.look_ahead(this.distance());
  }

  /** Moves the focus to the middle of the view. */
  look_ahead(distance: number): void {
    this.focus = this.ahead(distance);
  }

  within(position: Vec3): Vec3 {
    return this.unlimited ? position : min(max(position, this.min_), this.max_);
  }

  contains(p: Vec3): boolean {
    return (
      this.unlimited || p.every((v, i) => v >= this.min_[i]! - 1e-9 && v <= this.max_[i]! + 1e-9)
    );
  }

  /** Removes the part along up. */
  level_part(v: Vec3): Vec3 {
    return sub(v, scale(this.up, dot(v, this.up)));
  }

  /** Moves camera and focus together, as far as the limits allow. World units. */
  translate(by: Vec3): void {
    if (by[0] === 0 && by[1] === 0 && by[2] === 0) return;
    const position = this.within(add(this.pose.position, by));
    const moved = sub(position, this.pose.position);
    if (length(moved) === 0) return;
    this.focus = add(this.focus, moved);
    this.pose = { ...this.pose, position };
  }

  /** Moves camera and focus together to a point that the limits do not bind. */
  put(position: Vec3): void {
    this.focus = add(this.focus, sub(position, this.pose.position));
    this.pose = { ...this.pose, position };
  }

  /** Rolls the picture towards a level horizon by `share`. */
  level(share: number): void {
    const { position, orientation } = this.pose;
    const { view } = this;
    if (Math.abs(dot(view, this.up)) > Math.sin(steepest_level_rad)) return;
    const level_right = normalize(cross(view, this.up), right);
    const now_right = rotate(orientation, right);
    const roll = Math.atan2(dot(cross(now_right, level_right), view), dot(now_right, level_right));
    if (Math.abs(roll) < 1e-6) return;
    this.pose = { position, orientation: multiply(axis_angle(view, roll * share), orientation) };
  }

  /** Turns up and the camera about the view axis. Angles > 0 turn them clockwise in the picture. */
  roll(angle_rad: number): void {
    const by = axis_angle(this.view, angle_rad);
    this.up = rotate(by, this.up);
    const { position, orientation } = this.pose;
    this.pose = { position, orientation: multiply(by, orientation) };
  }

  /** What was down is up. About a level axis through `centre`, so that the horizon stays level. */
  turn_over(pose: Pose, centre: Vec3): Pose {
    const above = rotate(pose.orientation, [0, -1, 0]);
    const view = rotate(pose.orientation, forward);
    const ahead = normalize(this.level_part(add(view, scale(above, 1e-3))), right);
    const by = axis_angle(ahead, Math.PI);
    return {
      position: add(centre, rotate(by, sub(pose.position, centre))),
      orientation: multiply(by, pose.orientation),
    };
  }

  /** Where a camera sees the surface at `point` from that a visitor stands on, with `up` as up. */
  standing_before(point: Vec3, up: Vec3): Eye {
    const level = (v: Vec3): Vec3 => sub(v, scale(up, dot(v, up)));
    // A camera that looks straight down at the surface has its own up ahead.
    const above = rotate(this.pose.orientation, [0, -1, 0]);
    const ahead = normalize(level(add(this.view, scale(above, 1e-3))), right);
    const distance = Math.max(length(sub(this.pose.position, point)), this.nearest * 2);
    const away = sub(scale(up, Math.sin(standing_rad)), scale(ahead, Math.cos(standing_rad)));
    const position = this.within(add(point, scale(away, distance)));
    return { position, orientation: look_at(position, point, up), fov_y_rad: this.fov_y_rad };
  }

  /** Looks at the point from a third nearer. */
  facing(point: Vec3): Eye {
    const away = sub(this.pose.position, point);
    const distance = Math.max(length(away), 1e-9);
    const nearer = clamp(this.nearest * 4, distance * 0.67, distance);
    const position = this.within(add(point, scale(away, nearer / distance)));
    return { position, orientation: look_at(position, point, this.up), fov_y_rad: this.fov_y_rad };
  }

  private ahead(distance: number): Vec3 {
    return add(this.pose.position, scale(this.view, distance));
  }
}

function min(a: Vec3, b: Vec3): Vec3 {
  return [Math.min(a[0], b[0]), Math.min(a[1], b[1]), Math.min(a[2], b[2])];
}

function max(a: Vec3, b: Vec3): Vec3 {
  return [Math.max(a[0], b[0]), Math.max(a[1], b[1]), Math.max(a[2], b[2])];
}

// The viewer's own camera: what gestures, held keys and flights do to it. Pure: no DOM, no clock.
import {
  add,
  axis_angle,
  conjugate,
  dot,
  forward,
  look_at,
  right,
  rotate,
  scale,
  unit,
  type Vec3,
  clamp,
} from '../base/vector';
import { CameraRig, default_fov_y_rad } from './camera_rig';
import { ClearPath, type AskDistance } from './clear_path';
import type { Eye, Pose } from './eye';
import { glide, glide_time_s, type Flight } from './flight';
import { FlyController } from './fly_controller';
import type { CameraMode, ModeController } from './mode';
import { is_held, no_axes, type Axes, type Gesture } from './movement';
import { OrbitController } from './orbit_controller';
import type { OrthographicController } from './orthographic_controller';
import type { SceneSetup } from './scene_setup';
import { Smoothing } from './smoothing';
import { WalkController } from './walk_controller';
import type { Walker } from './walker';

const steepest_rad = (88 * Math.PI) / 180; // at 90 degrees "up" has no direction in the image
const turn_rad_per_s = 1.2;
const fast_factor = 4;
export const fastest = 16; // and 1 / fastest the slowest
const level_time_s = 0.25;

export class CameraController {
  private readonly rig_ = new CameraRig();
  private readonly walk_ = new WalkController(this.rig_);
  private readonly clear_path_ = new ClearPath();
  private readonly modes_: Readonly<Record<CameraMode, ModeController>> = {
    orbit: new OrbitController(this.rig_, this.clear_path_),
    fly: new FlyController(this.rig_),
    walk: this.walk_,
  };
  /** Of orthographic views; it loads when there is one. */
  private orthographic_: OrthographicController | undefined;
  private readonly smoothing_ = new Smoothing();
  private mode_: CameraMode = 'orbit';
  private scene_: SceneSetup | undefined;
  private speed_ = 1;
  private settled_ = true;
  private before_: { eye: Eye; distance: number } | undefined; // the orthographic view
  private flight_: { way: Flight; time_s: number; ended: (arrived: boolean) => void } | undefined;

  /** Time constant of the glide after a gesture. 0 turns it off, for people who asked for reduced motion. */
  set smoothing_s(time_s: number) {
    this.smoothing_.time_s = time_s;
  }

  get pose(): Pose {
    return this.rig_.pose;
  }

  get eye(): Eye {
    const { pose, fov_y_rad, view_height } = this.rig_;
    return { ...pose, fov_y_rad, view_height };
  }

  /** Whether rays are parallel. Flights and jumps change it. */
  get is_orthographic(): boolean {
    return this.rig_.view_height !== undefined;
  }

  /** Orthographic views can be moved from now on. */
  load_orthographic(make: (rig: CameraRig) => OrthographicController): void {
    this.orthographic_ ??= make(this.rig_);
  }

  /** Back to where the camera was before an orthographic view. */
  leave_orthographic(): void {
    if (!this.is_orthographic || !this.before_) return;
    const { eye, distance } = this.before_;
    this.jump(eye);
    this.rig_.look_ahead(distance);
  }

  /** Where leave_orthographic() leads. */
  get perspective_eye(): Eye {
    return (this.is_orthographic && this.before_?.eye) || this.eye;
  }

  /** The scene's scale to a visitor, world units. */
  get reach(): number {
    return this.rig_.reach;
  }

  get up(): Vec3 {
    return this.rig_.up;
  }

  /** The visitor's own factor on the speed of keys, sticks and flight. */
  get speed(): number {
    return this.speed_;
  }

  set speed(factor: number) {
    this.speed_ = clamp(factor, 1 / fastest, fastest);
  }

  /** From the eye to what the visitor looks at, world units; Infinity: unknown. */
  get sight_distance(): number {
    return this.controller.sight_distance;
  }

  get scene(): SceneSetup | undefined {
    return this.scene_;
  }

  get mode(): CameraMode {
    return this.mode_;
  }

  get fov_y_rad(): number {
    return this.rig_.fov_y_rad;
  }

  set fov_y_rad(value: number) {
    this.rig_.fov_y_rad = value;
  }

  /** Who says how far an orbiting camera may go; undefined: anywhere. */
  set asks_distance(ask: AskDistance | undefined) {
    this.clear_path_.ask = ask;
  }

  /** Who walks on the walkable area; undefined: it is not known, or there is none. */
  set walker(walker: Walker | undefined) {
    this.walk_.walker = walker;
  }

  load(scene: SceneSetup): void {
    this.end_flight(false);
    this.scene_ = scene;
    this.rig_.load(scene);
    this.clear_path_.forget();
    this.smoothing_.clear();
  }

  /** Back to the start. */
  reset(): void {
    if (this.scene_) this.load(this.scene_);
    this.fov_y_rad = this.start_fov_y_rad;
  }

  /** The scene's own, whatever the visitor or a link has chosen. */
  get start_fov_y_rad(): number {
    return this.scene_?.start_fov_y_rad ?? default_fov_y_rad;
  }

  /** Where reset() leads. */
  get start(): Eye | undefined {
    return this.scene_ && { ...this.scene_.start_pose, fov_y_rad: this.start_fov_y_rad };
  }

  /** Sets another start for reset(). The camera stays where it is. */
  start_at(eye: Eye | undefined): void {
    if (!this.scene_ || !eye) return;
    this.scene_ = { ...this.scene_, start_pose: eye, start_fov_y_rad: eye.fov_y_rad };
  }

  /** Follows a flight until it ends or the visitor moves. `ended` hears whether the camera arrived. */
  fly(way: Flight, ended: (arrived: boolean) => void = () => undefined): void {
    this.end_flight(false);
    this.smoothing_.clear();
    this.flight_ = { way, time_s: 0, ended };
  }

  get is_flying(): boolean {
    return this.flight_ !== undefined;
  }

  stop_flight(): void {
    this.end_flight(false);
  }

  /** Flies to where the mode looks at this point of the scene from. */
  focus_on(point: Vec3, at_once = false): void {
    this.fly_to(this.controller.approach(point), point, at_once);
  }

  /** Whether the camera may leave the scene's limits, until another scene. */
  set unlimited(unlimited: boolean) {
    this.rig_.unlimited = unlimited;
  }

  /** The point nearest to this one that the scene's limits allow. */
  within(position: Vec3): Vec3 {
    return this.rig_.within(position);
  }

  /** Puts the camera somewhere. The caller answers for the limits. */
  jump(to: Pose & Partial<Eye>): void {
    this.end_flight(false);
    this.see({ ...to, orientation: unit(to.orientation) });
    this.smoothing_.clear();
    this.rig_.refocus();
  }

  /** Flies there. From then on an orbiting camera circles `focus`. */
  fly_to(to: Eye, focus: Vec3, at_once: boolean): void {
    const ended = (arrived: boolean): void => {
      if (arrived) this.rig_.focus = focus;
    };
    this.fly(glide(this.eye, to, at_once ? 0 : glide_time_s(this.eye, to, this.reach)), ended);
  }

  set_mode(mode: CameraMode, at_once = false): void {
    this.leave_orthographic();
    if (mode === this.mode_) return;
    this.mode_ = mode;
    const to = this.controller.begin();
    if (to) this.look_from(to, at_once);
  }

  /** A walker comes to stand where the eyes are here. */
  stand(eyes: Vec3, at_once: boolean): void {
    this.look_from(this.walk_.standing(eyes), at_once);
  }

  /** Turns the scene in the picture, for captures that lie on their side or stand on their head. */
  turn_up(angle_rad: number): void {
    this.end_flight(false);
    this.rig_.roll(angle_rad);
    this.keep_up();
  }

  /** Half a turn, for captures that stand on their head: an orbiting camera sees them from above again. */
  turn_over(): void {
    this.end_flight(false);
    const over = (pose: Pose, focus: Vec3): Pose => {
      const turned = this.rig_.turn_over(pose, this.mode_ === 'orbit' ? focus : pose.position);
      return { ...turned, position: this.rig_.within(turned.position) };
    };
    if (this.scene_) {
      const start_pose = over(this.scene_.start_pose, this.scene_.focus);
      this.scene_ = { ...this.scene_, up: scale(this.rig_.up, -1), start_pose };
    }
    this.rig_.pose = over(this.rig_.pose, this.rig_.focus);
    this.rig_.up = scale(this.rig_.up, -1);
    this.rig_.refocus();
  }

  /** Another up (unit) that the scene keeps. */
  set_up(up: Vec3): void {
    this.rig_.up = up;
    this.keep_up();
  }

  /** Makes `up` (unit) the scene's up, and flies to where a visitor sees the surface at `point` from. */
  stand_on(point: Vec3, up: Vec3, at_once = false): void {
    const to = this.rig_.standing_before(point, up);
    this.set_up(up);
    this.fly_to(to, point, at_once);
  }

  gesture(gesture: Gesture): void {
    this.end_flight(false);
    if (this.is_orthographic) return this.smoothing_.ask(this.orthographic_?.asks(gesture) ?? {});
    switch (gesture.kind) {
      case 'look': {
        const { drag_rad } = this.controller;
        this.smoothing_.ask({ yaw: gesture.dx * drag_rad, pitch: gesture.dy * drag_rad });
        break;
      }
      case 'pan': {
        const height = 2 * this.rig_.distance() * Math.tan(this.fov_y_rad / 2);
        this.smoothing_.ask({ pan: [-gesture.dx * height, -gesture.dy * height, 0] });
        break;
      }
      case 'dolly':
        this.smoothing_.ask({ dolly: gesture.steps });
        break;
    }
  }

  /** No movement is left to make. */
  get at_rest(): boolean {
    return this.smoothing_.at_rest && this.settled_ && !this.flight_;
  }

  /** Moves by `dt_s`. Returns whether the camera moved. */
  step(dt_s: number, axes: Axes = no_axes): boolean {
    const { pose: before, view_height } = this.rig_;
    if (this.flight_ && !is_held(axes)) return this.follow_flight(dt_s);
    this.end_flight(false);
    this.hold(dt_s, axes);
    const due = this.smoothing_.take(dt_s, this.reach);
    this.turn(due.yaw, due.pitch);
    if (due.yaw !== 0 || due.pitch !== 0) this.rig_.level(1 - Math.exp(-dt_s / level_time_s));
    this.controller.move(rotate(this.pose.orientation, due.pan), due.climb);
    if (due.dolly !== 0) this.controller.dolly(due.dolly);
    this.settled_ = this.controller.settle?.(dt_s) ?? true;
    return before !== this.pose || view_height !== this.rig_.view_height;
  }

  private get controller(): ModeController {
    return (this.is_orthographic && this.orthographic_) || this.modes_[this.mode_];
  }

  private look_from(to: Eye, at_once: boolean): void {
    const ahead = scale(rotate(to.orientation, forward), this.rig_.distance());
    this.fly_to(to, add(to.position, ahead), at_once);
  }

  /** The scene keeps this up, and its start is upright in it. */
  private keep_up(): void {
    if (!this.scene_) return;
    const { up } = this.rig_;
    const { position, orientation } = this.scene_.start_pose;
    const ahead = add(position, rotate(orientation, forward));
    this.scene_ = {
      ...this.scene_,
      up,
      start_pose: { position, orientation: look_at(position, ahead, up) },
    };
  }

  private follow_flight(dt_s: number): boolean {
    const flight = this.flight_;
    if (!flight) return false;
    flight.time_s = Math.min(flight.time_s + dt_s, flight.way.duration_s);
    this.see(flight.way.at(flight.time_s));
    if (flight.time_s >= flight.way.duration_s) this.end_flight(true);
    return true;
  }

  private see({ position, orientation, fov_y_rad, view_height }: Pose & Partial<Eye>): void {
    if (view_height && !this.is_orthographic)
      this.before_ = { eye: this.eye, distance: this.rig_.distance() };
    this.rig_.pose = { position, orientation };
    this.rig_.view_height = view_height;
    if (fov_y_rad) this.fov_y_rad = fov_y_rad;
  }

  private end_flight(arrived: boolean): void {
    const flight = this.flight_;
    if (!flight) return;
    this.flight_ = undefined;
    this.rig_.refocus();
    flight.ended(arrived);
  }

  private hold(dt_s: number, axes: Axes): void {
    if (!is_held(axes)) return;
    if (this.is_orthographic)
      return this.smoothing_.ask(this.orthographic_?.held(axes, dt_s * this.speed) ?? {});
    const { speed, drag_rad, heading } = this.controller;
    const way = this.reach * this.speed * speed * (axes.fast ? fast_factor : 1) * dt_s;
    const turn = turn_rad_per_s * dt_s * Math.sign(drag_rad);
    const ahead = rotate(conjugate(this.pose.orientation), heading);
    this.smoothing_.ask({
      yaw: -axes.turn_right * turn,
      pitch: axes.turn_up * turn,
      pan: add(scale(right, axes.right * way), scale(ahead, axes.forward * way)),
      climb: axes.up * way,
    });
  }

  private turn(yaw: number, pitch: number): void {
    if (yaw !== 0) this.controller.turn(axis_angle(this.up, yaw));
    if (pitch === 0) return;
    const elevation = Math.asin(clamp(dot(this.rig_.view, this.up), -1, 1));
    const target = clamp(elevation + pitch, -steepest_rad, steepest_rad);
    const allowed = target - elevation;
    // A start pose may look straight down, beyond the limit. From there only the way back is open.
    if (allowed * pitch <= 0) return;
    this.controller.turn(axis_angle(rotate(this.pose.orientation, right), allowed));
  }
}

// The viewer's own camera: what gestures and held keys do to a pose. Pure: no DOM, no clock.
import {
  add,
  axis_angle,
  conjugate,
  cross,
  dot,
  forward,
  length,
  look_at,
  multiply,
  normalize,
  right,
  rotate,
  scale,
  sub,
  unit,
  type Quat,
  type Vec3,
} from '../base/vector';
import { limited_fov, type Eye, type Pose } from './eye';
import { glide, glide_time_s, type Flight } from './flight';
import type { CameraMode } from './mode';
import { is_held, no_axes, type Axes, type Gesture } from './movement';
import type { SceneSetup } from './scene_setup';

const steepest_rad = (88 * Math.PI) / 180; // at 90 degrees "up" has no direction in the image
const orbit_rad_per_height = Math.PI;
const turn_rad_per_s = 1.2;
const dolly_per_step = 0.12; // share of the distance to the focus
const fast_factor = 4;
const speed_share = { orbit: 0.6, fly: 0.6, walk: 0.25 } as const; // of the scene's scale, a second
const level_time_s = 0.25;
const rest_threshold = 1e-4;
export const default_fov_y_rad = (60 * Math.PI) / 180;

/** Movement that was asked for and not made yet. */
interface Pending {
  yaw: number; // rad about up; > 0 turns left
  pitch: number; // rad about the camera's x axis; > 0 looks up
  pan: Vec3; // world units along camera axes
  climb: number; // world units along up
  dolly: number; // steps
}

const nothing_pending = (): Pending => ({ yaw: 0, pitch: 0, pan: [0, 0, 0], climb: 0, dolly: 0 });

export class CameraController {
  private pose_: Pose = { position: [0, 0, 0], orientation: [0, 0, 0, 1] };
  private mode_: CameraMode = 'orbit';
  private fov_y_rad_ = default_fov_y_rad;
  private up_: Vec3 = [0, -1, 0];
  private focus_: Vec3 = [0, 0, 1];
  private min_: Vec3 = [0, 0, 0];
  private max_: Vec3 = [0, 0, 0];
  private reach_ = 1; // distance from start to focus: the scene's scale to a visitor
  private nearest_ = 0.1;
  private scene_: SceneSetup | undefined;
  private pending_ = nothing_pending();
  private flight_: { way: Flight; time_s: number; ended: (arrived: boolean) => void } | undefined;

  /** Time constant of the glide after a gesture; 0 for people who asked for reduced motion. */
  smoothing_s = 0.05;

  get pose(): Pose {
    return this.pose_;
  }

  get eye(): Eye {
    return { ...this.pose_, fov_y_rad: this.fov_y_rad_ };
  }

  /** The scene's scale to a visitor, world units. */
  get reach(): number {
    return this.reach_;
  }

  get up(): Vec3 {
    return this.up_;
  }

  /** Of what the visitor looks at; Infinity where nobody knows. */
  get sight_distance(): number {
    return this.mode_ === 'orbit' ? this.distance() : Infinity;
  }

  get scene(): SceneSetup | undefined {
    return this.scene_;
  }

  get mode(): CameraMode {
    return this.mode_;
  }

  get fov_y_rad(): number {
    return this.fov_y_rad_;
  }

  set fov_y_rad(value: number) {
    this.fov_y_rad_ = limited_fov(value);
  }

  load(scene: SceneSetup): void {
    this.scene_ = scene;
    this.up_ = normalize(scene.up, [0, -1, 0]);
    const start = scene.start_pose;
    this.pose_ = { position: start.position, orientation: unit(start.orientation) };
    this.fov_y_rad = scene.start_fov_y_rad ?? this.fov_y_rad_;
    this.focus_ = scene.focus;
    this.nearest_ = Math.max(scene.near_z, 1e-3) * 1.5;
    const to_focus = length(sub(scene.focus, start.position));
    this.reach_ = Math.max(to_focus, this.nearest_ * 2);
    if (to_focus < this.nearest_) this.focus_ = this.ahead(this.reach_);
    // The start is inside by definition; a scene without limits has min = max.
    const unlimited = scene.limits_max.every((v, i) => v <= scene.limits_min[i]!);
    this.min_ = unlimited ? [-Infinity, -Infinity, -Infinity] : min(scene.limits_min, start.position);
    this.max_ = unlimited ? [Infinity, Infinity, Infinity] : max(scene.limits_max, start.position);
    this.pending_ = nothing_pending();
  }

  /** Back to the start. */
  reset(): void {
    this.end_flight(false);
    if (this.scene_) this.load(this.scene_);
    this.fov_y_rad_ = this.scene_?.start_fov_y_rad ?? default_fov_y_rad;
  }

  /** Another start, kept for reset(). The camera stays where it is. */
  start_at(eye: Eye): void {
    if (!this.scene_) return;
    this.scene_ = { ...this.scene_, start_pose: eye, start_fov_y_rad: eye.fov_y_rad };
  }

  /** Moves along a way; any other movement ends it. `ended` hears whether the camera arrived. */
  fly(way: Flight, ended: (arrived: boolean) => void = () => undefined): void {
    this.end_flight(false);
    this.pending_ = nothing_pending();
    this.flight_ = { way, time_s: 0, ended };
  }

  stop_flight(): void {
    this.end_flight(false);
  }

  get in_flight(): boolean {
    return this.flight_ !== undefined;
  }

  /** Turns to a point of the scene and comes nearer; walking, goes there. */
  focus_on(point: Vec3, at_once = false): void {
    const to = this.mode_ === 'walk' ? this.before(point) : this.facing(point);
    const ended = (arrived: boolean): void => {
      if (arrived) this.focus_ = point;
    };
    this.fly(glide(this.eye, to, at_once ? 0 : glide_time_s(this.eye, to, this.reach_)), ended);
  }

  /** Puts the camera somewhere; limits are the caller's business. */
  jump(pose: Pose): void {
    this.end_flight(false);
    this.pose_ = { position: pose.position, orientation: unit(pose.orientation) };
    this.pending_ = nothing_pending();
    this.focus_ = this.ahead(this.distance());
  }

  set_mode(mode: CameraMode): void {
    if (mode === 'orbit' && this.mode_ !== 'orbit') this.focus_ = this.ahead(this.distance());
    this.mode_ = mode;
  }

  /** For captures that came upside down. */
  flip_up(): void {
    this.up_ = scale(this.up_, -1);
    const view = rotate(this.pose_.orientation, forward);
    this.pose_ = {
      position: this.pose_.position,
      orientation: multiply(axis_angle(view, Math.PI), this.pose_.orientation),
    };
  }

  gesture(gesture: Gesture): void {
    this.end_flight(false);
    const pending = this.pending_;
    switch (gesture.kind) {
      case 'look': {
        // Flying, the scene stays under the pointer; orbiting, a full height is half a turn.
        const rad = this.mode_ === 'orbit' ? -orbit_rad_per_height : this.fov_y_rad_;
        pending.yaw += gesture.dx * rad;
        pending.pitch += gesture.dy * rad;
        break;
      }
      case 'pan': {
        const height = 2 * this.distance() * Math.tan(this.fov_y_rad_ / 2);
        pending.pan = add(pending.pan, [-gesture.dx * height, -gesture.dy * height, 0]);
        break;
      }
      case 'dolly':
        pending.dolly += gesture.steps;
        break;
    }
  }

  /** No movement is left to make. */
  get at_rest(): boolean {
    const { yaw, pitch, pan, climb, dolly } = this.pending_;
    const still = yaw === 0 && pitch === 0 && dolly === 0 && climb === 0 && length(pan) === 0;
    return still && !this.flight_;
  }

  /** Moves by `dt_s`. Returns whether the camera moved. */
  step(dt_s: number, axes: Axes = no_axes): boolean {
    const before = this.pose_;
    if (this.flight_ && !is_held(axes)) return this.follow_flight(dt_s);
    this.end_flight(false);
    this.hold(dt_s, axes);
    const share = this.smoothing_s > 0 ? 1 - Math.exp(-dt_s / this.smoothing_s) : 1;
    const due = this.take(share);
    this.turn(due.yaw, due.pitch);
    if (due.yaw !== 0 || due.pitch !== 0) this.level(1 - Math.exp(-dt_s / level_time_s));
    this.translate(add(this.grounded(rotate(this.pose_.orientation, due.pan)), scale(this.up_, due.climb)));
    this.dolly(due.dolly);
    return before !== this.pose_;
  }

  private follow_flight(dt_s: number): boolean {
    const flight = this.flight_;
    if (!flight) return false;
    flight.time_s = Math.min(flight.time_s + dt_s, flight.way.duration_s);
    const { fov_y_rad, ...pose } = flight.way.at(flight.time_s);
    this.pose_ = pose;
    this.fov_y_rad = fov_y_rad;
    if (flight.time_s >= flight.way.duration_s) this.end_flight(true);
    return true;
  }

  private end_flight(arrived: boolean): void {
    const flight = this.flight_;
    if (!flight) return;
    this.flight_ = undefined;
    this.focus_ = this.ahead(this.distance());
    flight.ended(arrived);
  }

  /** Nearer to the point by a third, looking at it. */
  private facing(point: Vec3): Eye {
    const away = sub(this.pose_.position, point);
    const distance = Math.max(length(away), 1e-9);
    const nearer = Math.min(distance, Math.max(distance * 0.67, this.nearest_ * 4));
    const position = this.within(add(point, scale(away, nearer / distance)));
    return {
      position,
      orientation: look_at(position, point, this.up_),
      fov_y_rad: this.fov_y_rad_,
    };
  }

  /** On foot: a step before the point, at the height of now, turned towards it. */
  private before(point: Vec3): Eye {
    const way = this.on_ground(sub(point, this.pose_.position));
    const distance = Math.max(length(way), 1e-9);
    const gone = Math.max(0, distance - 0.1 * this.reach_);
    const position = this.within(add(this.pose_.position, scale(way, gone / distance)));
    const level = look_at(position, add(position, way), this.up_);
    return { position, orientation: level, fov_y_rad: this.fov_y_rad_ };
  }

  private within(position: Vec3): Vec3 {
    return min(max(position, this.min_), this.max_);
  }

  private on_ground(v: Vec3): Vec3 {
    return sub(v, scale(this.up_, dot(v, this.up_)));
  }

  /** Walking keeps its height. */
  private grounded(v: Vec3): Vec3 {
    return this.mode_ === 'walk' ? this.on_ground(v) : v;
  }

  /** Where "forward" leads, unit. */
  private ahead_direction(): Vec3 {
    const view = rotate(this.pose_.orientation, forward);
    return this.mode_ === 'walk' ? normalize(this.on_ground(view), view) : view;
  }

  private hold(dt_s: number, axes: Axes): void {
    const speed = this.reach_ * speed_share[this.mode_] * (axes.fast ? fast_factor : 1) * dt_s;
    const pending = this.pending_;
    // Orbiting, turning right means to walk around the focus to the right: the view turns left.
    const turn = turn_rad_per_s * dt_s * (this.mode_ === 'orbit' ? -1 : 1);
    pending.yaw -= axes.turn_right * turn;
    pending.pitch += axes.turn_up * turn;
    const ahead = rotate(conjugate(this.pose_.orientation), this.ahead_direction());
    pending.pan = add(pending.pan, scale(right, axes.right * speed));
    pending.pan = add(pending.pan, scale(ahead, axes.forward * speed));
    pending.climb += axes.up * speed;
  }

  /** Takes `share` of what is pending, or all of it once it is too little to be seen. */
  private take(share: number): Pending {
    const all = this.pending_;
    const rest =
      Math.abs(all.yaw) + Math.abs(all.pitch) + Math.abs(all.dolly) + (length(all.pan) + Math.abs(all.climb)) / this.reach_;
    const s = rest < rest_threshold ? 1 : share;
    const taken = {
      yaw: all.yaw * s,
      pitch: all.pitch * s,
      pan: scale(all.pan, s),
      climb: all.climb * s,
      dolly: all.dolly * s,
    };
    this.pending_ =
      s === 1
        ? nothing_pending()
        : {
            yaw: all.yaw - taken.yaw,
            pitch: all.pitch - taken.pitch,
            pan: sub(all.pan, taken.pan),
            climb: all.climb - taken.climb,
            dolly: all.dolly - taken.dolly,
          };
    return taken;
  }

  private turn(yaw: number, pitch: number): void {
    if (yaw !== 0) this.apply_turn(axis_angle(this.up_, yaw));
    if (pitch === 0) return;
    const view = rotate(this.pose_.orientation, forward);
    const elevation = Math.asin(Math.min(1, Math.max(-1, dot(view, this.up_))));
    const target = Math.min(Math.max(elevation + pitch, -steepest_rad), steepest_rad);
    const allowed = target - elevation;
    // Beyond the limit (a start pose that looks straight down) only the way back is open.
    if (allowed * pitch <= 0) return;
    this.apply_turn(axis_angle(rotate(this.pose_.orientation, right), allowed));
  }

  private apply_turn(turn: Quat): void {
    const orientation = multiply(turn, this.pose_.orientation);
    if (this.mode_ !== 'orbit') {
      this.pose_ = { position: this.pose_.position, orientation };
      return;
    }
    const position = add(this.focus_, rotate(turn, sub(this.pose_.position, this.focus_)));
    if (this.inside(position)) this.pose_ = { position, orientation };
  }

  /** Lets the horizon of a tilted start pose become level while the visitor looks around. */
  private level(share: number): void {
    const { position, orientation } = this.pose_;
    const view = rotate(orientation, forward);
    if (Math.abs(dot(view, this.up_)) > Math.cos((5 * Math.PI) / 180)) return;
    const level_right = normalize(cross(view, this.up_), right);
    const now_right = rotate(orientation, right);
    const roll = Math.atan2(dot(cross(now_right, level_right), view), dot(now_right, level_right));
    if (Math.abs(roll) < 1e-6) return;
    this.pose_ = { position, orientation: multiply(axis_angle(view, roll * share), orientation) };
  }

  /** Moves camera and focus together, as far as the limits allow. */
  private translate(by: Vec3): void {
    if (by[0] === 0 && by[1] === 0 && by[2] === 0) return;
    const position = this.within(add(this.pose_.position, by));
    const moved = sub(position, this.pose_.position);
    if (length(moved) === 0) return;
    this.focus_ = add(this.focus_, moved);
    this.pose_ = { ...this.pose_, position };
  }

  private dolly(steps: number): void {
    if (steps === 0) return;
    if (this.mode_ !== 'orbit') {
      this.translate(scale(this.ahead_direction(), steps * this.reach_ * 0.08));
      return;
    }
    const offset = sub(this.pose_.position, this.focus_);
    const distance = Math.max(length(offset), 1e-9);
    const wanted = distance * (1 - dolly_per_step) ** steps;
    const target = steps > 0 ? Math.min(distance, Math.max(wanted, this.nearest_)) : wanted;
    const position = add(this.focus_, scale(offset, target / distance));
    if (this.inside(position)) this.pose_ = { ...this.pose_, position };
  }

  private inside(p: Vec3): boolean {
    return p.every((v, i) => v >= this.min_[i]! - 1e-9 && v <= this.max_[i]! + 1e-9);
  }

  /** To the focus, and never so near that panning would stand still. */
  private distance(): number {
    const along = dot(
      sub(this.focus_, this.pose_.position),
      rotate(this.pose_.orientation, forward),
    );
    return along > this.nearest_ ? along : this.reach_;
  }

  private ahead(distance: number): Vec3 {
    return add(this.pose_.position, scale(rotate(this.pose_.orientation, forward), distance));
  }
}

function min(a: Vec3, b: Vec3): Vec3 {
  return [Math.min(a[0], b[0]), Math.min(a[1], b[1]), Math.min(a[2], b[2])];
}

function max(a: Vec3, b: Vec3): Vec3 {
  return [Math.max(a[0], b[0]), Math.max(a[1], b[1]), Math.max(a[2], b[2])];
}

import {
  add,
  dot,
  length,
  look_at,
  normalize,
  same,
  scale,
  sub,
  type Vec3,
  clamp,
} from '../base/vector';
import type { Eye } from './eye';
import { FlyController } from './fly_controller';
import type { Walker } from './walker';

const step_before = 0.1; // of the scene's scale: a visitor stands before what they pointed at
const eye_heights_per_s = 1.1;
const eye_heights_per_notch = 0.5;
const settles_in_s = 0.12; // a stair of 0.17 m is no jump then, and the eyes are not late by much
const settled_share = 1e-3; // of the eye height
const steepest_sine = 0.35; // of a view that comes down to the floor

/**
 * The camera looks around as in flight. On the walkable area, where that is known, it stays at eye
 * height and passes no wall; else it keeps its height.
 */
export class WalkController extends FlyController {
  private walker_: Walker | undefined;
  private eyes_: Vec3 | undefined; // of the walker
  private put_: Vec3 | undefined; // where the camera was left. Elsewhere, it has been moved meanwhile
  private away_: Vec3 = [0, 0, 0]; // of the camera from the walker's eyes

  get walker(): Walker | undefined {
    return this.walker_;
  }

  set walker(walker: Walker | undefined) {
    this.walker_ = walker;
    this.eyes_ = this.put_ = undefined;
  }

  override get speed(): number {
    return this.walker_ ? (eye_heights_per_s * this.walker_.eye_height) / this.rig.reach : 0.25;
  }

  override get heading(): Vec3 {
    const { view } = this.rig;
    return normalize(this.rig.level_part(view), view);
  }

  /** Comes to the floor, if that is no more than a step away. */
  override begin(): Eye | undefined {
    const eyes = this.walker_?.stand_near(this.rig.pose.position);
    return eyes && this.standing(eyes);
  }

  /** With the eyes there, and the view about level. */
  standing(position: Vec3): Eye {
    const { rig } = this;
    const rise = clamp(dot(rig.view, rig.up), -steepest_sine, steepest_sine);
    const ahead = add(scale(this.heading, Math.sqrt(1 - rise * rise)), scale(rig.up, rise));
    return {
      position,
      orientation: look_at(position, add(position, ahead), rig.up),
      fov_y_rad: rig.fov_y_rad,
    };
  }

  override move(movement: Vec3, climb: number): void {
    const way = this.rig.level_part(movement);
    const { walker_: walker } = this;
    if (!walker) return super.move(way, climb);
    if (length(way) === 0) return;
    const { position } = this.rig.pose;
    if (!this.put_ || !same(this.put_, position)) {
      this.eyes_ = walker.stand_near(position);
      this.away_ = this.eyes_ ? sub(position, this.eyes_) : [0, 0, 0];
    }
    if (!this.eyes_) return super.move(way, climb);
    if (this.rig.contains(position) && !this.rig.contains(add(position, way))) return;
    const before = this.eyes_;
    this.eyes_ = walker.walk(way);
    // The eyes follow the floor up and down a little later.
    const rise = dot(sub(this.eyes_, before), this.rig.up);
    this.away_ = sub(this.away_, scale(this.rig.up, rise));
    this.put();
  }

  settle(dt_s: number): boolean {
    if (!this.eyes_ || !this.put_ || !this.walker_ || length(this.away_) === 0) return true;
    if (!same(this.put_, this.rig.pose.position)) return true;
    this.away_ = scale(this.away_, Math.exp(-dt_s / settles_in_s));
    if (length(this.away_) < settled_share * this.walker_.eye_height) this.away_ = [0, 0, 0];
    this.put();
    return length(this.away_) === 0;
  }

  override dolly(steps: number): void {
    const { walker_: walker } = this;
    if (walker)
      this.move(scale(this.heading, steps * eye_heights_per_notch * walker.eye_height), 0);
    else super.dolly(steps);
  }

  /** Stops a step before the point, at the present height, and faces it. */
  override approach(point: Vec3): Eye {
    const { rig } = this;
    const way = rig.level_part(sub(point, rig.pose.position));
    const distance = Math.max(length(way), 1e-9);
    const gone = Math.max(0, distance - step_before * rig.reach);
    const position = rig.within(add(rig.pose.position, scale(way, gone / distance)));
    const orientation = look_at(position, add(position, way), rig.up);
    return { position, orientation, fov_y_rad: rig.fov_y_rad };
  }

  private put(): void {
    if (!this.eyes_) return;
    this.put_ = add(this.eyes_, this.away_);
    this.rig.put(this.put_);
  }
}

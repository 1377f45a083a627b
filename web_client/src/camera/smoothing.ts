import { add, length, scale, type Vec3 } from '../base/vector';

/** What visitors ask of a camera, in any mode. */
export interface Movement {
  readonly yaw: number; // rad about up; > 0 turns left
  readonly pitch: number; // rad about the camera's x axis; > 0 looks up
  readonly pan: Vec3; // world units along camera axes
  readonly climb: number; // world units along up
  readonly dolly: number; // steps
}

const none: Movement = { yaw: 0, pitch: 0, pan: [0, 0, 0], climb: 0, dolly: 0 };
const rest_threshold = 1e-4;

/** a + times * b. */
const sum = (a: Movement, b: Movement, times: number): Movement => ({
  yaw: a.yaw + b.yaw * times,
  pitch: a.pitch + b.pitch * times,
  pan: add(a.pan, scale(b.pan, times)),
  climb: a.climb + b.climb * times,
  dolly: a.dolly + b.dolly * times,
});

/** Hands out the movement that visitors ask for bit by bit, so that the camera glides. Pure. */
export class Smoothing {
  private left_ = none;

  /** Time constant of the glide; 0: all movement is due at once. */
  time_s = 0.05;

  ask(more: Partial<Movement>): void {
    this.left_ = sum(this.left_, { ...none, ...more }, 1);
  }

  clear(): void {
    this.left_ = none;
  }

  get at_rest(): boolean {
    const { yaw, pitch, pan, climb, dolly } = this.left_;
    return yaw === 0 && pitch === 0 && dolly === 0 && climb === 0 && length(pan) === 0;
  }

  /** Movement due after `dt_s`. What is too small to see is due at once. `reach`: the scene's scale. */
  take(dt_s: number, reach: number): Movement {
    const { left_: left } = this;
    const seen =
      Math.abs(left.yaw) +
      Math.abs(left.pitch) +
      Math.abs(left.dolly) +
      (length(left.pan) + Math.abs(left.climb)) / reach;
    if (this.time_s === 0 || seen < rest_threshold) {
      this.left_ = none;
      return left;
    }
    const share = 1 - Math.exp(-dt_s / this.time_s);
    const due = sum(none, left, share);
    this.left_ = sum(left, due, -1);
    return due;
  }
}

import type { Gesture } from './movement';

interface Moved {
  readonly time_ms: number;
  readonly dx: number;
  readonly dy: number;
}

const looks_back_ms = 80;
const rested_ms = 40; // a pointer that rested this long before its release does not throw the view
const least_speed = 0.2; // view heights a second
const fades_in_s = 0.28;

/** Lets the view glide to rest after a moving pointer is lifted. Pure. */
export class Inertia {
  private kind_: 'look' | 'pan' = 'look';
  private trail_: Moved[] = [];
  private velocity_: readonly [x: number, y: number] = [0, 0]; // view heights a second

  /** False for people who asked for reduced motion. */
  enabled = true;

  get active(): boolean {
    return this.velocity_[0] !== 0 || this.velocity_[1] !== 0;
  }

  moved(gesture: Gesture, time_ms: number): void {
    this.stop();
    if (gesture.kind === 'dolly') {
      this.trail_ = []; // the fingers of a pinch are lifted one by one
      return;
    }
    if (gesture.kind !== this.kind_) this.trail_ = [];
    this.kind_ = gesture.kind;
    this.trail_.push({ time_ms, dx: gesture.dx, dy: gesture.dy });
    this.trail_ = this.trail_.filter((step) => step.time_ms >= time_ms - looks_back_ms);
  }

  /** The last pointer was lifted. Returns whether the view glides on. */
  released(time_ms: number): boolean {
    const trail = this.trail_;
    this.trail_ = [];
    const [first, last] = [trail[0], trail[trail.length - 1]];
    if (!this.enabled || !first || !last || trail.length < 3) return false;
    if (time_ms - last.time_ms > rested_ms || last.time_ms <= first.time_ms) return false;
    const seconds = (last.time_ms - first.time_ms) / 1000;
    const later = trail.slice(1); // the first step came before the measured time
    const velocity = [
      later.reduce((sum, { dx }) => sum + dx, 0) / seconds,
      later.reduce((sum, { dy }) => sum + dy, 0) / seconds,
    ] as const;
    if (Math.hypot(...velocity) >= least_speed) this.velocity_ = velocity;
    return this.active;
  }

  stop(): void {
    this.velocity_ = [0, 0];
  }

  /** The movement of the next `dt_s`. */
  step(dt_s: number): Gesture | undefined {
    if (!this.active) return undefined;
    const left = Math.exp(-dt_s / fades_in_s);
    const way = fades_in_s * (1 - left);
    const [x, y] = this.velocity_;
    this.velocity_ = Math.hypot(x, y) * left < 0.02 ? [0, 0] : [x * left, y * left];
    return { kind: this.kind_, dx: x * way, dy: y * way };
  }
}

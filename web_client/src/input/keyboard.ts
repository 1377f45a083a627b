import { no_axes, sum_of, type Axes } from '../camera/movement';

// Keys by position (KeyboardEvent.code), so that WASD has the same shape on every layout.
const movement: Readonly<Record<string, Partial<Axes>>> = {
  KeyW: { forward: 1 },
  KeyS: { forward: -1 },
  KeyA: { right: -1 },
  KeyD: { right: 1 },
  KeyE: { up: 1 },
  KeyQ: { up: -1 },
  ArrowLeft: { turn_right: -1 },
  ArrowRight: { turn_right: 1 },
  ArrowUp: { turn_up: 1 },
  ArrowDown: { turn_up: -1 },
};

// A tap moves the camera for this many steps, however short it was. This holds too when it comes before
// the scene is loaded.
const least_steps = 5;

interface Hold {
  steps: number; // that it has moved the camera so far
  released: boolean;
}

/** Turns held movement keys into camera axes. */
export class HeldKeys {
  private readonly held_ = new Map<string, Hold>();
  private fast_ = false;

  /** Returns whether the key is one of ours. */
  down(code: string, shift: boolean): boolean {
    this.fast_ = shift;
    if (!(code in movement)) return false;
    const hold = this.held_.get(code);
    if (hold) hold.released = false;
    else this.held_.set(code, { steps: 0, released: false });
    return true;
  }

  up(code: string, shift: boolean): void {
    this.fast_ = shift;
    const hold = this.held_.get(code);
    if (!hold) return;
    hold.released = true;
    if (hold.steps >= least_steps) this.held_.delete(code);
  }

  /** The page lost the keyboard: key-up events will not come. */
  release_all(): void {
    this.held_.clear();
    this.fast_ = false;
  }

  /** Call this once for each step of the camera. */
  axes(): Axes {
    if (this.held_.size === 0) return no_axes;
    const held = [...this.held_.keys()].map((code) => movement[code] ?? {});
    for (const [code, hold] of this.held_) {
      hold.steps += 1;
      if (hold.released && hold.steps >= least_steps) this.held_.delete(code);
    }
    return sum_of(...held, { fast: this.fast_ });
  }
}

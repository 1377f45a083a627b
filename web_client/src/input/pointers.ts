import { clamp } from '../base/vector';
import type { Timers } from '../base/clock';
import type { Gesture } from '../camera/movement';

/** The part of PointerEvent that matters here. Pixels of the view, y down. */
export interface PointerSample {
  id: number;
  type: string; // 'mouse', 'touch' or 'pen'
  x: number;
  y: number;
  buttons: number;
  shift: boolean;
  primary: boolean; // no other one of its type is down
}

/**
 * A click, a tap, the second of two, or a press: a long one, or Alt and a click. `x`, `y`: shares of the view's
 * width and height, y down.
 */
export interface Pointed {
  readonly x: number;
  readonly y: number;
  readonly how: 'click' | 'touch' | 'double tap' | 'press';
}

interface Held {
  readonly type: string;
  x: number;
  y: number;
}

const primary_button = 1;
// Spreading two fingers by this factor equals one notch of a wheel.
const pinch_factor_per_step = 1.13;
const wheel_px_per_step = 100;
const longest_pinch_px = 50; // a mouse wheel with Ctrl gives more
const pinch_factor = 8;
const wheel_px_per_line = 33; // deltaMode 1: lines
const wheel_px_per_page = 400; // deltaMode 2: pages

/** Notches towards the scene. `factor`: by which two fingers are spread. */
export const pinch_steps = (factor: number): number =>
  factor > 0 ? Math.log(factor) / Math.log(pinch_factor_per_step) : 0;

/**
 * Turns pointers into camera gestures. A mouse drag looks with the primary button, and pans with any
 * other button or with shift. One finger looks; two fingers pan and pinch.
 */
export class Pointers {
  private readonly held_ = new Map<number, Held>();

  get count(): number {
    return this.held_.size;
  }

  down(p: PointerSample): void {
    // Some drivers lose the end of a touch.
    for (const [id, { type }] of this.held_)
      if (p.primary && type === p.type) this.held_.delete(id);
    if (this.held_.size < 2) this.held_.set(p.id, { type: p.type, x: p.x, y: p.y });
  }

  /** Returns whether a pointer was down. */
  release_all(): boolean {
    const was_held = this.held_.size > 0;
    this.held_.clear();
    return was_held;
  }

  /** Returns whether this was the last pointer. */
  up(id: number): boolean {
    return this.held_.delete(id) && this.held_.size === 0;
  }

  move(p: PointerSample, view_height_px: number): Gesture[] {
    const held = this.held_.get(p.id);
    if (!held || view_height_px <= 0) return [];
    const before = this.two_fingers();
    const dx = (p.x - held.x) / view_height_px;
    const dy = (p.y - held.y) / view_height_px;
    held.x = p.x;
    held.y = p.y;
    const after = this.two_fingers();
    if (before && after) {
      const gestures: Gesture[] = [{ kind: 'pan', dx: dx / 2, dy: dy / 2 }];
      if (before.spread > 0 && after.spread > 0) {
        gestures.push({ kind: 'dolly', steps: pinch_steps(after.spread / before.spread) });
      }
      return gestures;
    }
    const pans = p.type === 'mouse' && (p.shift || (p.buttons & primary_button) === 0);
    return [{ kind: pans ? 'pan' : 'look', dx, dy }];
  }

  private two_fingers(): { spread: number } | undefined {
    const [a, b] = [...this.held_.values()];
    return a && b ? { spread: Math.hypot(a.x - b.x, a.y - b.y) } : undefined;
  }
}

const tap_slack_px = 10; // fingers and hands tremble
const double_tap_ms = 350;
const double_tap_px = 30;

/** Whether a pointer that went down at the first point has stayed there. Places in px. */
export const is_tap = (down_x: number, down_y: number, x: number, y: number): boolean =>
  Math.hypot(x - down_x, y - down_y) <= tap_slack_px;

/** Tells taps, clicks and double ones from drags. Times in ms, places in px. */
export class Taps {
  private down_: { x: number; y: number } | undefined;
  private last_: { time_ms: number; x: number; y: number } | undefined;

  down(x: number, y: number, is_only: boolean): void {
    this.down_ = is_only ? { x, y } : undefined;
  }

  /** What is down is no tap. */
  cancel(): void {
    this.down_ = this.last_ = undefined;
  }

  up(time_ms: number, x: number, y: number): 'drag' | 'tap' | 'double tap' {
    const { down_: down, last_: last } = this;
    this.down_ = this.last_ = undefined;
    if (!down || !is_tap(down.x, down.y, x, y)) return 'drag';
    const is_second =
      last !== undefined &&
      time_ms - last.time_ms <= double_tap_ms &&
      Math.hypot(x - last.x, y - last.y) <= double_tap_px;
    if (!is_second) this.last_ = { time_ms, x, y };
    return is_second ? 'double tap' : 'tap';
  }
}

const long_press_ms = 600;

/** Tells a long press from taps and drags. */
export class LongPress {
  private pressed_:
    | { readonly x: number; readonly y: number; readonly cancel: () => void }
    | undefined;

  constructor(private readonly timers_: Timers) {}

  /** A pointer is down. Calls `pressed` if it stays there for long. */
  begin(x: number, y: number, pressed: () => void): void {
    this.end();
    const cancel = this.timers_.after(long_press_ms, () => {
      this.pressed_ = undefined;
      pressed();
    });
    this.pressed_ = { x, y, cancel };
  }

  /** The pointer is here. Returns whether a long press may still come; a drag ends it. */
  may_come(x: number, y: number): boolean {
    if (this.pressed_ && !is_tap(this.pressed_.x, this.pressed_.y, x, y)) this.end();
    return this.pressed_ !== undefined;
  }

  end(): void {
    this.pressed_?.cancel();
    this.pressed_ = undefined;
  }
}

/**
 * Notches towards the scene. `delta_mode` is that of WheelEvent. A pinch on a trackpad comes as a wheel
 * with ctrl and small deltas.
 */
export function wheel_steps(delta_y: number, delta_mode: number, ctrl: boolean): number {
  const px_per_unit =
    delta_mode === 1 ? wheel_px_per_line : delta_mode === 2 ? wheel_px_per_page : 1;
  const px = delta_y * px_per_unit;
  const is_pinch = ctrl && Math.abs(px) < longest_pinch_px;
  const steps = (-px * (is_pinch ? pinch_factor : 1)) / wheel_px_per_step;
  return clamp(steps, -8, 8);
}

import type { Gesture } from '../camera/camera_controller';

/** The part of PointerEvent that matters here. Pixels of the view, y down. */
export interface PointerSample {
  id: number;
  type: string; // 'mouse', 'touch' or 'pen'
  x: number;
  y: number;
  buttons: number;
  shift: boolean;
}

interface Held {
  x: number;
  y: number;
}

const primary_button = 1;
// One wheel notch's worth of dolly for spreading two fingers by this factor.
const pinch_factor_per_step = 1.13;
const wheel_px_per_step = 100;
const wheel_px_per_line = 33; // deltaMode 1: lines
const wheel_px_per_page = 400; // deltaMode 2: pages

/**
 * Turns pointers into camera gestures: a mouse drag looks (primary button) or pans (any other, or
 * with shift); one finger looks; two fingers pan and pinch.
 */
export class Pointers {
  private readonly held_ = new Map<number, Held>();

  down(p: PointerSample): void {
    if (this.held_.size < 2) this.held_.set(p.id, { x: p.x, y: p.y });
  }

  up(id: number): void {
    this.held_.delete(id);
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
        const steps = Math.log(after.spread / before.spread) / Math.log(pinch_factor_per_step);
        gestures.push({ kind: 'dolly', steps });
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

/** `delta_mode` as in WheelEvent. A trackpad's pinch comes as a wheel with ctrl and small deltas. */
export function wheel_gesture(delta_y: number, delta_mode: number, ctrl: boolean): Gesture {
  const px_per_unit = delta_mode === 1 ? wheel_px_per_line : delta_mode === 2 ? wheel_px_per_page : 1;
  const steps = (-delta_y * px_per_unit * (ctrl ? 8 : 1)) / wheel_px_per_step;
  return { kind: 'dolly', steps: Math.min(8, Math.max(-8, steps)) };
}

// Decides whether warping helps, and how much overscan it needs. Pure.
import { percentile, TimeWindow } from '../base/time_window';
import type { Sides } from './warp';

export type WarpMode = 'auto' | 'on' | 'off';
/** Whether pictures are warped, or why not. */
export type WarpState = 'on' | 'off' | 'no_gpu' | 'too_slow';

// There are few steps, because each change restarts the stream. Most turns are about the vertical axis.
// They need width, and height for the corners only. Two factors reach half as far again as a single one
// would with the same number of pixels, twice those of the view.
const widths = [1, 1.12, 1.26, 1.42, 1.6] as const;
const heights = [1, 1.12, 1.26] as const;
const none: Sides = { x: 1, y: 1 };
const mode_on_least: Sides = { x: 1.26, y: 1.12 };
const span_us = 1e6;
const least_samples = 12;
const calm_before_less_us = 10e6; // a turn may soon need the overscan of the last one again
const slow_draw_us = 8000; // half a refresh: slower drawing makes the picture late

export class WarpPolicy {
  private readonly widths_ = new TimeWindow(span_us);
  private readonly heights_ = new TimeWindow(span_us);
  private readonly draw_us_ = new TimeWindow(span_us);
  may_overscan = true;
  private overscan_ = none;
  private needed_us_ = -Infinity; // when the present overscan was last needed
  private too_slow_ = false;
  private mode_: WarpMode = 'auto';

  constructor(private readonly can_warp_: boolean) {}

  set mode(mode: WarpMode) {
    this.mode_ = mode;
    this.overscan_ = mode === 'on' ? mode_on_least : none;
    this.too_slow_ = false;
  }

  get active(): boolean {
    return this.can_warp_ && this.mode_ !== 'off' && !(this.too_slow_ && this.mode_ === 'auto');
  }

  get overscan(): Sides {
    return this.active && this.may_overscan ? this.overscan_ : none;
  }

  get state(): WarpState {
    if (!this.can_warp_) return 'no_gpu';
    if (this.mode_ === 'off') return 'off';
    return this.active ? 'on' : 'too_slow';
  }

  /**
   * The view of a moving camera was drawn. `needed`: the overscan that covers it (see reach()). Returns
   * whether the policy wants another overscan.
   */
  drawn(needed: Sides, draw_us: number, now_us: number): boolean {
    if (!this.active) return false;
    this.widths_.push(now_us, needed.x);
    this.heights_.push(now_us, needed.y);
    this.draw_us_.push(now_us, draw_us);
    const [x, y] = [this.widths_.values(now_us), this.heights_.values(now_us)];
    if (x.length < least_samples) return false;
    if (percentile(this.draw_us_.values(now_us), 0.5) > slow_draw_us && this.mode_ === 'auto') {
      this.too_slow_ = true;
      return true; // nor are depths wanted any more
    }
    return this.choose({ x: percentile(x, 0.9), y: percentile(y, 0.9) }, now_us);
  }

  private choose(needed: Sides, now_us: number): boolean {
    const least = this.mode_ === 'on' ? mode_on_least : none;
    const now = this.overscan_;
    const wanted = {
      x: Math.max(fitting(widths, needed.x), least.x),
      y: Math.max(fitting(heights, needed.y), least.y),
    };
    // Turns change their axis, so a side that is too large stays while the other one is needed.
    const is_needed = (now.x > 1 && wanted.x >= now.x) || (now.y > 1 && wanted.y >= now.y);
    if (is_needed) this.needed_us_ = now_us;
    if (wanted.x > now.x || wanted.y > now.y) {
      this.overscan_ = { x: Math.max(wanted.x, now.x), y: Math.max(wanted.y, now.y) };
      this.needed_us_ = now_us;
      return true;
    }
    const is_less = wanted.x < now.x || wanted.y < now.y;
    if (!is_less || now_us - this.needed_us_ <= calm_before_less_us) return false;
    this.overscan_ = wanted;
    return true;
  }
}

const fitting = (factors: readonly number[], needed: number): number =>
  factors.find((factor) => factor >= needed - 0.005) ?? factors[factors.length - 1]!;

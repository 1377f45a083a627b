// Whether warping helps, and how much more than the view has to be rendered for it. Pure.
import { percentile, TimeWindow } from '../stats/window';

export type WarpMode = 'auto' | 'on' | 'off';

/** Sides of the picture by those of the view. Each change opens the stream anew: so few. */
const overscans = [1, 1.08, 1.16, 1.26, 1.4] as const;
const mode_on_least = 1.16;
const span_us = 2e6;
const least_samples = 30;
const calm_before_less_us = 10e6; // an overscan that was needed lately may be needed again
const slow_draw_us = 8000; // half a refresh: such drawing makes the picture late

export class WarpPolicy {
  private readonly reach_ = new TimeWindow(span_us);
  private readonly draw_us_ = new TimeWindow(span_us);
  private overscan_ = 1;
  private needed_us_ = -Infinity; // when the present overscan was last needed
  private too_slow_ = false;
  private mode_: WarpMode = 'auto';

  constructor(private readonly can_warp_: boolean) {}

  set mode(mode: WarpMode) {
    this.mode_ = mode;
    this.overscan_ = mode === 'on' ? mode_on_least : 1;
    this.too_slow_ = false;
  }

  get active(): boolean {
    return this.can_warp_ && this.mode_ !== 'off' && !(this.too_slow_ && this.mode_ === 'auto');
  }

  get overscan(): number {
    return this.active ? this.overscan_ : 1;
  }

  /** For people. */
  get state(): string {
    if (!this.can_warp_) return 'off: needs WebGL2 by a GPU';
    if (this.mode_ === 'off') return 'off';
    if (!this.active) return 'off: drawing is too slow here';
    return `on, ${Math.round((this.overscan_ - 1) * 100)} % overscan`;
  }

  /**
   * A moving camera was drawn. `reach`: of the view in a picture without overscan (see reach()).
   * Returns whether another overscan is wanted.
   */
  drawn(reach: number, draw_us: number, now_us: number): boolean {
    if (!this.active) return false;
    this.reach_.push(now_us, reach);
    this.draw_us_.push(now_us, draw_us);
    const reaches = this.reach_.values(now_us);
    if (reaches.length < least_samples) return false;
    if (percentile(this.draw_us_.values(now_us), 0.5) > slow_draw_us && this.mode_ === 'auto') {
      this.too_slow_ = true;
      return this.overscan_ > 1;
    }
    return this.choose(percentile(reaches, 0.9), now_us);
  }

  private choose(needed: number, now_us: number): boolean {
    const largest = overscans[overscans.length - 1]!;
    const fitting = overscans.find((factor) => factor >= needed - 0.005) ?? largest;
    const wanted = Math.max(fitting, this.mode_ === 'on' ? mode_on_least : 1);
    if (wanted >= this.overscan_) this.needed_us_ = now_us;
    const changes =
      wanted > this.overscan_ ||
      (wanted < this.overscan_ && now_us - this.needed_us_ > calm_before_less_us);
    if (changes) this.overscan_ = wanted;
    return changes;
  }
}

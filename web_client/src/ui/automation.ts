// window.catgs: a small surface for tests and for pages that drive the viewer (README.md).
import type { Pose } from '../camera/eye';
import type { StatsSnapshot } from '../stats/metrics';
import type { Snapshot } from '../worker/messages';

export interface Automation {
  /** Puts the camera there. Camera axes: x right, y down, z forward; quaternion x, y, z, w. */
  setPose(pose: Pose, fovYRad?: number): void;
  pose(): Pose;
  /** Resolves when the newest pose is shown and its picture has been refined. */
  settled(): Promise<void>;
  /** RGBA pixels of the shown picture at its native size, with the frame's header. */
  snapshot(): Promise<Snapshot>;
  stats(): Promise<StatsSnapshot>;
}

declare global {
  interface Window {
    catgs?: Automation;
  }
}

// The server refines a still picture with a few more frames and then says nothing; it takes no
// longer between two of them than this, or than a few of the intervals seen so far.
const least_quiet_ms = 400;
const quiet_intervals = 4;

/** Knows when the picture has come to rest. */
export class Settling {
  private last_shown_ms_ = 0;
  private interval_ms_ = 0;
  private waiting_: (() => void)[] = [];
  private cancel_: () => void = () => undefined;

  /** `is_current`: the shown picture is the one of the camera as it is. */
  constructor(
    private readonly is_current_: () => boolean,
    private readonly now_ms_: () => number,
    private readonly after_: (delay_ms: number, action: () => void) => () => void,
  ) {}

  presented(): void {
    const now_ms = this.now_ms_();
    this.interval_ms_ = this.last_shown_ms_ > 0 ? now_ms - this.last_shown_ms_ : 0;
    this.last_shown_ms_ = now_ms;
    this.look();
  }

  wait(): Promise<void> {
    return new Promise((resolve) => {
      this.waiting_.push(resolve);
      this.look();
    });
  }

  private look(): void {
    this.cancel_();
    if (this.waiting_.length === 0) return;
    if (!this.is_current_()) return; // the next presented() looks again
    const quiet_ms = Math.max(least_quiet_ms, Math.min(this.interval_ms_, 1000) * quiet_intervals);
    const left_ms = this.last_shown_ms_ + quiet_ms - this.now_ms_();
    if (left_ms <= 0) {
      for (const resolve of this.waiting_.splice(0)) resolve();
      return;
    }
    this.cancel_ = this.after_(left_ms, () => this.look());
  }
}

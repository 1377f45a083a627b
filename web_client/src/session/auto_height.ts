const steps_px = [240, 300, 360, 450, 540, 630, 720, 900, 1080, 1440, 2160] as const;
const first_px = 720;
const patience = 3; // looks in a row that must agree
const growth_margin = 0.6; // grow only when the larger picture is expected to be well in time

/**
 * Picks the height at which the server renders and encodes moving pictures fast enough. Small pictures
 * that move beat large ones that do not. It is fed once a second with the server's mean time per
 * frame. Pure.
 */
export class AutoHeight {
  private height_px_ = first_px;
  private votes_ = 0;

  constructor(private readonly target_frame_ms_ = 1000 / 24) {}

  /** The height to ask for in a view of this height. */
  height_px(view_height_px: number): number {
    return Math.min(this.height_px_, view_height_px);
  }

  /** Returns whether the height has changed. `frame_ms` is NaN when no frame came. */
  look(frame_ms: number, view_height_px: number): boolean {
    const vote = this.vote(frame_ms, view_height_px);
    this.votes_ = vote !== 0 && Math.sign(this.votes_) === vote ? this.votes_ + vote : vote;
    if (Math.abs(this.votes_) < patience) return false;
    this.votes_ = 0;
    const now_px = this.height_px(view_height_px);
    const next_px = vote < 0 ? this.fitting(now_px, frame_ms) : step_above(now_px);
    const changed = next_px !== this.height_px_;
    this.height_px_ = next_px;
    return changed;
  }

  /** -1: too slow. 1: room to grow. 0: as it should be. */
  private vote(frame_ms: number, view_height_px: number): number {
    const now_px = this.height_px(view_height_px);
    if (frame_ms > this.target_frame_ms_ * 1.2) return now_px > steps_px[0] ? -1 : 0;
    const grown_ms = frame_ms * (step_above(now_px) / now_px) ** 2;
    const can_grow = now_px < view_height_px && now_px < steps_px[steps_px.length - 1]!;
    return can_grow && grown_ms < this.target_frame_ms_ * growth_margin ? 1 : 0;
  }

  /** The largest step within the time budget. Time grows with the number of pixels. */
  private fitting(height_px: number, frame_ms: number): number {
    const wanted_px = height_px * Math.sqrt(this.target_frame_ms_ / frame_ms);
    return [...steps_px].reverse().find((step) => step <= wanted_px) ?? steps_px[0];
  }
}

function step_above(height_px: number): number {
  return steps_px.find((step) => step > height_px) ?? steps_px[steps_px.length - 1]!;
}

import { TimeWindow } from '../base/time_window';

const history_limit = 256;
const most_ticks = 1000;

/**
 * Samples the pose age at each tick of the nominal rate: now minus the sample time of the pose that the
 * shown picture has. So a frozen picture counts. Ticks at which the newest pose is shown do not count,
 * because nothing is late then. After a rest the age begins when the camera moves again.
 */
export class PoseAge {
  private readonly ages_us_: TimeWindow;
  private sent_: { id: bigint; time_us: number }[] = [];
  private shown_us_: number | undefined; // sample time of the shown pose
  private next_tick_us_ = 0;

  constructor(
    span_us: number,
    private tick_us_: number,
  ) {
    this.ages_us_ = new TimeWindow(span_us);
  }

  set_rate(fps: number): void {
    if (fps > 0) this.tick_us_ = 1e6 / fps;
  }

  sent(id: bigint, time_us: number): void {
    this.sent_.push({ id, time_us });
    if (this.sent_.length > history_limit) this.sent_.shift();
  }

  shown(id: bigint, time_us: number, now_us: number): void {
    this.advance(now_us);
    this.shown_us_ = time_us;
    this.sent_ = this.sent_.filter((pose) => pose.id > id);
  }

  values(now_us: number): readonly number[] {
    this.advance(now_us);
    return this.ages_us_.values(now_us);
  }

  /** Ages of the last seconds in which the camera moved. */
  newest(): readonly number[] {
    return this.ages_us_.newest();
  }

  /** Adds the ticks since the last call. The same picture was shown at all of them. */
  private advance(now_us: number): void {
    const newer = this.sent_[0];
    if (this.shown_us_ === undefined || !newer) {
      this.next_tick_us_ = now_us;
      return;
    }
    // The shown pose was the newest one until just before the first newer sample.
    const right_until_us = Math.max(this.shown_us_, newer.time_us - this.tick_us_);
    const first = Math.max(this.next_tick_us_, newer.time_us, now_us - most_ticks * this.tick_us_);
    let tick_us = first;
    for (; tick_us <= now_us; tick_us += this.tick_us_) {
      this.ages_us_.push(tick_us, tick_us - right_until_us);
    }
    this.next_tick_us_ = tick_us;
  }
}
